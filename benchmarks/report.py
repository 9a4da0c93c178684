"""Makes the results of ./run bench from the benchmarks' parts:
    report.py DIR [--publish]
reads DIR/parts/*.json (Google Benchmark's, repeated), writes DIR/results.json (a row for each name,
with medians), DIR/headline.md, and DIR/*.dat for plots.gp, and prints the table and the exponents.
--publish puts the headline into benchmarks/README.md and four figures of it into README.md, between
their marks."""

import collections
import datetime
import glob
import json
import math
import pathlib
import re
import statistics
import sys

import rivals

ROOT = pathlib.Path(__file__).parent.parent
GAINS = {"soft": "1e2", "ordinary": "1e3", "stiff": "1e5"}
TIMES = ("real_time", "cpu_time")
NANOSECONDS = {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9}


def plain(row):
    """A row that was timed call by call: its time is the median, its name the one it was given."""
    if "median_us" not in row:
        return row
    per_unit = 1e3 / NANOSECONDS[row["time_unit"]]
    return {**row, "name": re.sub(r"/(iterations:\d+|manual_time)", "", row["name"]),
            "real_time": row["median_us"] * per_unit, "cpu_time": row["median_us"] * per_unit}


def merge(parts):
    """One row for each name: times are medians, `spread` is (longest - shortest) / median."""
    repeated = collections.defaultdict(list)
    for part in parts:
        for row in part["benchmarks"]:
            if row.get("run_type") != "aggregate":
                repeated[plain(row)["name"]].append(plain(row))
    rows = []
    for runs in repeated.values():
        times = sorted(run.get("cpu_time", 0) for run in runs)
        row = dict(runs[len(runs) // 2])
        for key in TIMES:
            if key in row:
                row[key] = statistics.median(run[key] for run in runs)
        row["repetitions"] = len(runs)
        row["repetition_index"] = 0
        row["spread"] = (times[-1] - times[0]) / row["cpu_time"] if row.get("cpu_time") else 0
        rows.append(row)
    return {"context": parts[0]["context"], "benchmarks": rows}


def microseconds(row):
    """CPU time, or real time for several threads."""
    kind = "real_time" if row["name"].endswith("/real_time") else "cpu_time"
    return row[kind] * NANOSECONDS[row["time_unit"]] / 1e3


def is_too_short(row):
    """True if the search for its number of repetitions was interrupted, so that it ran a few times, cold."""
    nanoseconds = row["cpu_time"] * NANOSECONDS[row["time_unit"]]
    return nanoseconds < 1e5 and nanoseconds * row["iterations"] < 2e5


class Results:
    def __init__(self, merged):
        self.footprints = [r for r in merged["benchmarks"] if r["name"].startswith("footprint/")]
        rows = [r for r in merged["benchmarks"]
                if not r.get("error_occurred") and r not in self.footprints]
        self.too_short = [r["name"] for r in rows if is_too_short(r)]
        self.rows = {r["name"]: r for r in rows if not is_too_short(r)}

    def time(self, name):
        return microseconds(self.rows[name]) if name in self.rows else None

    def simulations(self, gains, whose):
        """(error, us, method) of all runs."""
        for name, row in self.rows.items():
            parts = name.split("/")
            if parts[:3] == ["simulation", gains, whose]:
                yield row["error"], microseconds(row), "/".join(parts[3:])

    def fastest(self, gains, whose, accuracy):
        good = [s for s in self.simulations(gains, whose) if s[0] <= accuracy]
        return min(good, key=lambda s: s[1]) if good else None


def us(value):
    if value is None:
        return "-"
    return f"{value:.0f}" if value >= 100 else f"{value:#.3g}"


def share(microseconds):
    """Of a period of 1 ms."""
    return f"{microseconds / 10:.2g} %"


def comparison(results, what, ours, rivals, notice=""):
    """A row of the headline: the fastest of the rivals, and what a user notices, where {ours} and {rival}
    stand for the parts of a period of 1 ms that both take."""
    mine = results.time(ours)
    known = [(results.time(name), label) for name, label in rivals if results.time(name)]
    if mine is None:
        return None
    if not known:
        return [what, us(mine), "-", "", "", notice.format(ours=share(mine), rival="-")]
    best = min(known)
    return [what, us(mine), us(best[0]), best[1], f"{best[0] / mine:.2g}",
            notice.format(ours=share(mine), rival=share(best[0]))]


def headline(results):
    rows = [
        comparison(results, "spectrum of 6 modes, tracked, with proved bounds", "spectrum/tracked/6",
                   [("spectrum/path_eigen/6", "Eigen"), ("spectrum/path_lapack/6", "LAPACK")],
                   "modes of every tick for {ours} of a period; without proof {rival}"),
        comparison(results, "the same, values only", "spectrum/values_only/6", [],
                   "little: only a host that reads no shapes saves this"),
        comparison(results, "the same, nothing has changed", "spectrum/reused/6", [],
                   "an arm at rest has its modes at no cost"),
        comparison(results, "7 modes, tracked, symmetric", "spectrum/tracked_full/7",
                   [("spectrum/eigen_full/7", "Eigen")],
                   "modes of every tick of a seven-joint arm for {ours} of a period; without proof {rival}"),
        comparison(results, "7 modes, tracked, K and C not symmetric",
                   "spectrum/tracked_nonsymmetric/7", [],
                   "the same under a load or with jacobian_rate: {ours} of a period"),
        comparison(results, "14 modes of an arm with elastic joints, tracked", "spectrum/tracked/14",
                   [("spectrum/path_eigen/14", "Eigen")],
                   "modes of motors and links in every tick for {ours} of a period; without proof {rival}"),
        comparison(results, "spectrum of 6 modes, from nothing, with bounds", "spectrum/direct/6",
                   [("spectrum/eigen/6", "Eigen"), ("spectrum/lapack/6", "LAPACK")],
                   "the first tick, and one after a jump, has its modes too, for {ours} of a period"),
        comparison(results, "dynamics of 7 joints", "dynamics/dashpot/7",
                   [("dynamics/kdl/7", "KDL"), ("dynamics/pinocchio/7", "Pinocchio")],
                   "nothing in a tick, {ours} of a period against {rival}; searches over many postures "
                   "end sooner"),
        comparison(results, "tick: Cartesian law, safety", "tick/cartesian/7", [],
                   "the torque is there after {ours} of a period"),
        comparison(results, "tick: with modes and snapshot", "tick/full/7", [],
                   "modes need no thread of their own: {ours} of a period"),
        comparison(results, "tick: with modes of an arm with elastic joints", "tick/elastic/7", [],
                   "twice as many modes, in the tick as well: {ours} of a period"),
        comparison(results, "tick: with ratio damping", "tick/design/7", [],
                   "the damping follows the arm for {ours} of a period"),
        comparison(results, "tick: with modes under a load", "tick/loaded/7", [],
                   "modes of an arm that holds a load, in the tick as well: {ours} of a period"),
        comparison(results, "tick: with modes, once in a millisecond", "tick/paced/7", [],
                   "the real time of a loop at 1 kHz: {ours} of a period"),
        comparison(results, "tick: with modes, caches cold", "tick/evicted/7", [],
                   "the same beside a camera or a planner: {ours} of a period"),
        comparison(results, "spectrum of 6 modes, tracked, once in a millisecond",
                   "spectrum/paced/6", [("spectrum/eigen_paced/6", "Eigen"),
                                        ("spectrum/lapack_paced/6", "LAPACK")],
                   "of a loop at 1 kHz {ours} of a period; without proof {rival}"),
        comparison(results, "spectrum of 6 modes, tracked, caches cold", "spectrum/evicted/6",
                   [("spectrum/eigen_evicted/6", "Eigen"), ("spectrum/lapack_evicted/6", "LAPACK")],
                   "the same beside a camera or a planner: {ours} of a period; without proof {rival}"),
    ]
    return [row for row in rows if row]


def machine(context):
    model = "unknown processor"
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            model = line.split(":", 1)[1].strip()
            break
    return (f"{model}, {context['num_cpus']} x {context['mhz_per_cpu'] / 1000:.1f} GHz, "
            f"{datetime.date.today().isoformat()}")


def markdown(rows, context):
    lines = [f"CPU time, median of repetitions in random order; {machine(context)}.", "",
             "| | Dashpot, us | fastest rival, us | which | rival / Dashpot | what a user notices |",
             "|---|---|---|---|---|---|"]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def footprint_table(results):
    """Of ticks of 7 joints; of that with modes by namespaces as well."""
    lines = ["Lines of 64 bytes that a tick of 7 joints touches, counted by callgrind:", "",
             "| | instructions | lines of code | lines of data |", "|---|---|---|---|"]
    for row in results.footprints:
        lines.append(f"| {row['name'].removeprefix('footprint/')} | {row['instructions']} | "
                     f"{row['code_lines']} | {row['data_lines']} |")
        if row["name"] == "footprint/tick/full/7":
            lines += [f"| - {part} | {counts['instructions']} | {counts['code_lines']} | "
                      f"{counts['data_lines']} |" for part, counts in row["parts"].items()]
    return "\n".join(lines) + "\n" if results.footprints else ""


SPECTRA = [("from nothing", "direct", "eigen", "lapack"),
           ("tracked", "tracked", "path_eigen", "path_lapack"),
           ("tracked, n joints", "tracked_full", "eigen_full")]


def backward_errors(results, what, size):
    """(whose, worst normwise backward error, us) of a spectrum of this kind and number of modes."""
    found = []
    for whose, name in zip(("Dashpot", "Eigen", "LAPACK"), what[1:]):
        row = results.rows.get(f"spectrum/{name}/{size}")
        if row and "backward_error" in row:
            found.append((whose, row["backward_error"], microseconds(row)))
    return found


def backward_error_table(results):
    lines = []
    for what in SPECTRA:
        for size in range(1, 100):
            found = backward_errors(results, what, size)
            text = "  ".join(f"{whose} {error:.1e} ({us(time)} us)" for whose, error, time in found)
            if found:
                lines.append(f"  {size:2} modes, {what[0]:18} {text}")
    return lines


def backward_error_sentence(results):
    parts = []
    for what in SPECTRA[:2]:
        found = backward_errors(results, what, 6)
        if len(found) > 1:
            parts.append(f"{what[0]}: " + ", ".join(f"{w} {error:.1e}" for w, error, _ in found))
    return "Worst backward error of the 6 modes, " + "; ".join(parts) + ".\n" if parts else ""


def passes_table(results):
    """Of 6 modes: what a proved bound costs as iterations are added, against solving directly."""
    lines = []
    for family in ("light_well", "critical_well", "heavy_well"):
        for method in ["moved_1e-11", "moved_1e-9", "moved_1e-7", "moved_1e-5", "moved_1e-3",
                       "moved_1e-2", "moved_1e-1", "working", "direct", "extended"]:
            row = results.rows.get(f"spectrum_error/{family}/ours_{method}/6")
            if not row:
                continue
            iterations = f"{row['mean_iterations']:4.2f} iterations" if "mean_iterations" in row else ""
            if row.get("direct_share", 0) > 0:
                iterations += f", {row['direct_share']:.0%} solved directly"
            lines.append(f"  {family:14} {method:12} {us(microseconds(row)):>5} us  bound "
                         f"{row['bound']:.1e}  error {row['error']:.1e}  {iterations}")
    return lines


def exponents(results):
    """Time = c n^p, by least squares of the logarithms."""
    families = collections.defaultdict(list)
    pattern = re.compile(r"((?:spectrum|dynamics|tick|growth|design)/\w+)/(\d+)(?:/real_time)?$")
    for name, row in results.rows.items():
        match = pattern.match(name)
        if match:
            families[match[1]].append((int(match[2]), microseconds(row)))
    lines = []
    for family, points in sorted(families.items()):
        points = sorted(p for p in points if p[0] >= 2 or "threads" in family)
        if len(points) < 3:
            continue
        x = [math.log(p[0]) for p in points]
        y = [math.log(p[1]) for p in points]
        middle_x, middle_y = statistics.mean(x), statistics.mean(y)
        slope = (sum((a - middle_x) * (b - middle_y) for a, b in zip(x, y)) /
                 sum((a - middle_x)**2 for a in x))
        lines.append(f"  {family:28} n^{slope:4.2f}  ({points[0][0]} to {points[-1][0]})")
    return lines


def front(points):
    """The (time, error) that no other beats in both."""
    best = []
    for time, error in sorted(points):
        if not best or error < best[-1][1]:
            best.append((time, error))
    return best


def write_points(file, points):
    file.writelines(f"{time:.6g} {min(max(error, 1e-17), 10):.6g}\n" for time, error in points)


def write_plot_data(results, directory):
    for gains in GAINS:
        for whose in ("ours", "odeint", "mujoco"):
            methods = collections.defaultdict(list)
            for error, time, method in results.simulations(gains, whose):
                methods[method.split("/")[0]].append((time, error))
            with open(directory / f"simulation_{gains}_{whose}.dat", "w") as file:
                for method, points in sorted(methods.items()):
                    file.write(f"# {method}\n")
                    write_points(file, front(points))
                    file.write("\n")
            with open(directory / f"simulation_{gains}_{whose}_front.dat", "w") as file:
                write_points(file, front(sum(methods.values(), [])))
    for family in ("light", "critical", "heavy"):
        for scaling in ("well", "badly"):
            rows = collections.defaultdict(list)
            for name, row in results.rows.items():
                parts = name.split("/")
                if parts[:2] == ["spectrum_error", f"{family}_{scaling}"]:
                    rows[parts[2]].append((microseconds(row), row["error"]))
            for method, points in rows.items():
                with open(directory / f"spectrum_{family}_{scaling}_{method}.dat", "w") as file:
                    write_points(file, sorted(points))


def figures(results, context):
    """The four figures of README.md; the rival, where there is one, is the fastest that ran."""
    rows = [
        comparison(results, "one control tick, safety and tracked modes included", "tick/full/7", []),
        comparison(results, "the same with ratio damping", "tick/design/7", []),
        comparison(results, "six modes, tracked, with proved bounds", "spectrum/tracked/6",
                   [("spectrum/path_eigen/6", "Eigen"), ("spectrum/path_lapack/6", "LAPACK")]),
        comparison(results, "dynamics of seven joints", "dynamics/dashpot/7",
                   [("dynamics/kdl/7", "KDL"), ("dynamics/pinocchio/7", "Pinocchio")]),
    ]
    if None in rows:
        sys.exit("report.py: a figure of README.md was not measured; nothing is published")
    lines = [f"| CPU time, {machine(context)} | us | fastest rival, us |", "|---|---|---|"]
    lines += [f"| {what} | {mine} | {f'{rival} ({whose})' if whose else '-'} |"
              for what, mine, rival, whose, _, _ in rows]
    return "\n".join(lines) + "\n"


def put_between(path, name, text):
    """Replaces the text between the marks of this name."""
    begin, end = f"<!-- {name} of ./run bench -->\n", f"<!-- end of {name} -->\n"
    before, rest = path.read_text().split(begin)
    path.write_text(before + begin + text + end + rest.split(end)[1])


def main():
    directory = pathlib.Path(sys.argv[1])
    names = sorted(glob.glob(str(directory / "parts" / "*.json")))
    # A program without benchmarks after the filter writes nothing.
    parts = [json.load(open(name)) for name in names if pathlib.Path(name).stat().st_size]
    merged = merge(parts)
    (directory / "results.json").write_text(json.dumps(merged, indent=1))
    results = Results(merged)
    text = markdown(headline(results), merged["context"])
    errors = backward_error_sentence(results)
    for more in (footprint_table(results), errors):
        text += "\n" + more if more else ""
    (directory / "headline.md").write_text(text)
    write_plot_data(results, directory)
    print(text)
    print("Spectra, worst backward error (and time):")
    print("\n".join(backward_error_table(results)))
    print("\nSpectra of 6 modes, time against proved bound as iterations are added (relative change since")
    print("the last spectrum), and solved directly with residuals of growing precision:")
    print("\n".join(passes_table(results)))
    print(f"\nRivals: {rivals.versions(parts)}. Spectra of 6 modes beside ours, solved directly:")
    print("\n".join(rivals.spectra(results.rows, microseconds)))
    print("\nDynamics of 7 joints, all terms unless named, beside all of ours:")
    print("\n".join(rivals.dynamics(results.rows, microseconds)))
    print("\nSimulation, the fastest to an accuracy (and how much slower the rival is):")
    print("\n".join(rivals.simulations(results, GAINS)))
    print("\nGrowth with the number of joints, modes, configurations, threads:")
    print("\n".join(exponents(results)))
    if results.too_short:
        print("\nLeft out, because they ran too short (a busy machine?); run again:")
        print("  " + ", ".join(results.too_short))
    if "--publish" in sys.argv:
        short = figures(results, merged["context"])
        put_between(ROOT / "benchmarks" / "README.md", "headline", text)
        put_between(ROOT / "README.md", "figures", short)


main()

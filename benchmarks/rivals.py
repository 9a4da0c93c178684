"""Results of report.py for all rivals: their versions, and tables of ratios to ours."""

import re

ACCURACIES = [10.0**-k for k in range(3, 10)]  # rad
FAMILIES = [f"{damping}_{scaling}" for damping in ("light", "critical", "heavy")
            for scaling in ("well", "badly")]


def versions(parts):
    """Names and versions of the rivals that the programs were built with, as they say themselves."""
    known = {"Arb", "Eigen", "LAPACK", "Pinocchio", "mujoco", "mujoco_newer"}
    found = {name: version for part in parts for name, version in part["context"].items()
             if name in known}
    return ", ".join(f"{name} {version}" for name, version in sorted(found.items()))


def ratio(row, ours, microseconds):
    """rival / ours, with the spreads of both over the repetitions."""
    times = microseconds(row) / microseconds(ours)
    return f"{times:7.2f}x  (spreads {row['spread']:4.0%}, {ours['spread']:4.0%})"


def spectra(rows, microseconds):
    """Of 6 modes: error and proved bound of each method, and its time beside ours solved directly."""
    lines = []
    for family in FAMILIES:
        ours = rows.get(f"spectrum_error/{family}/ours_direct/6")
        for method in ("ours_direct", "eigen", "dgeev", "dggev", "dggev3", "quadeig", "arb_64",
                       "arb_128"):
            row = rows.get(f"spectrum_error/{family}/{method}/6")
            if not row or not ours:
                continue
            bound = f"bound {row['bound']:.1e}" if "bound" in row else "no bound     "
            lines.append(f"  {family:14} {method:12} {microseconds(row):9.4g} us  "
                         f"{ratio(row, ours, microseconds)}  error {row['error']:.1e}  {bound}")
    return lines


def dynamics(rows, microseconds):
    """Of 7 joints: all terms, and each of Pinocchio's functions, beside all of ours."""
    ours = rows.get("dynamics/dashpot/7")
    names = sorted((name for name in rows if re.fullmatch(r"dynamics/\w+/7", name)),
                   key=lambda name: microseconds(rows[name]))
    return [f"  {name.split('/')[1]:30} {microseconds(rows[name]):9.4g} us  "
            f"{ratio(rows[name], ours, microseconds)}" for name in names] if ours else []


def simulations(results, gains):
    """Of every accuracy, ours and the fastest rival."""
    lines = []
    for name in gains:
        for accuracy in ACCURACIES:
            found = {whose: results.fastest(name, whose, accuracy)
                     for whose in ("ours", "odeint", "mujoco", "mujoco_newer")}
            if not found["ours"] or not found["odeint"]:
                continue
            text = "  ".join(f"{whose} {f[1]:7.0f} us ({f[2]})"
                             for whose, f in found.items() if f)
            ratio = min(f[1] for w, f in found.items() if f and w != "ours") / found["ours"][1]
            lines.append(f"  {name:8} {accuracy:.0e} rad  {ratio:5.2f}x  {text}")
    return lines

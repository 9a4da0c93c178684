#!/usr/bin/env python3
"""The effect of elastic joints on an impedance: tables in Markdown, and one for elastic.gp.

usage: elastic.py DASHPOT DIR

First the differences in modes and gain margin between rigid and elastic joints, by the stiffness of the
shoulder's gear. Then the ratios of the double diagonalisation on the same elastic arm, with the inertia
of the links alone and with the motors' inertia as well. Everything comes from `dashpot
design` and `dashpot audit`. DIR/elastic.txt has the gain margin over the stiffness for motor and link.
"""
import json
import math
import statistics
import subprocess
import sys
import tempfile

# URDF, base, tip, reflected inertia (of fr3_drake and iiwa14), home
ARMS = {"Panda": ("panda", "panda_link0", "panda_hand_tcp",
                  [0.606, 0.606, 0.462, 0.462, 0.206, 0.206, 0.206], [0, -0.785, 0, -2.356, 0, 1.571, 0.785]),
        "iiwa 14": ("iiwa14", "iiwa_link_0", "iiwa_link_ee_kuka",
                    [3.382, 3.382, 3.382, 3.382, 1.321, 1.162, 1.162], [0, 0.5, 0, -1.4, 0, 1.0, 0.3])}
STIFFNESS = [400, 400, 400, 20, 20, 20]
WRIST = [1, 1, 1, 1, 0.5, 0.5, 0.5]  # of the shoulder's gear
RATIO = 0.7
LOOP = ["--period", "1 ms", "--delay", "1"]


def run(*words):
    done = subprocess.run([sys.argv[1], *words, "--json"], text=True, check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout)


def numbers(values):
    return ",".join(f"{value:.6g}" for value in values)


def arm_options(arm, inertia):
    return ["--urdf", f"sim/models/{arm[0]}.urdf", "--base", arm[1], "--tip", arm[2],
            "--reflected-inertia", numbers(inertia)]


def gear_options(stiffness, damping_ratio, inertia, sensor):
    """Gears whose own damping ratio, of the motor on its spring, is `damping_ratio`."""
    gears = [stiffness * share for share in WRIST]
    dampers = [2 * damping_ratio * math.sqrt(k * b) for k, b in zip(gears, inertia)]
    return ["--gear-stiffness", numbers(gears), "--gear-damping", numbers(dampers), "--position-sensor", sensor]


def postures(arm, count=8):
    """Around home, by an additive sequence."""
    return [[q + 0.5 * (2 * ((k * 0.61803 + 0.37 * i) % 1) - 1) for i, q in enumerate(arm[4])]
            for k in range(count)]


def designed(arm, inertia, q):
    """C_C of the double diagonalisation with this inertia of the motors."""
    return run("design", *arm_options(arm, inertia), "--q", numbers(q), "--task-stiffness",
               numbers(STIFFNESS), "--damping-ratio", str(RATIO))["task_damping"]


def audit(arm, inertia, q, damping, *more):
    rows = [[STIFFNESS[i] if i == j else 0 for j in range(6)] for i in range(6)]
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", encoding="ascii") as file:
        json.dump({"gains": {"task": {"stiffness": rows, "damping": damping}}}, file)
        file.flush()
        return run("audit", *arm_options(arm, inertia), "--q", numbers(q), "--gains", file.name,
                   "--mode", "cartesian", *LOOP, *more)["posture"]


def table(*rows):
    for i, row in enumerate(rows):
        print("| " + " | ".join(row) + " |")
        if i == 0:
            print("|" + "---|" * len(row))
    print()


def impedance_modes(posture):
    """The six that are slowest: the others are the gears'."""
    return posture["modes"][-6:]


def rigid_beside_elastic():
    cases = [(arm, q, designed(arm, arm[3], q)) for arm in ARMS.values() for q in postures(arm)]
    rigid = [audit(arm, arm[3], q, damping) for arm, q, damping in cases]
    print(f"{len(cases)} postures; margin of the arm with rigid joints, median: "
          f"{statistics.median(posture['gain_margin'] for posture in rigid):.3g}\n")
    rows = [["shoulder's gear, N m/rad", "gear's ratio", "motor measured: frequency error, median / worst",
             "ratio error, worst", "margin, median", "link measured: margin, median", "unstable"]]
    for damping_ratio in (0.01, 0.05):
        for stiffness in (1e5, 3e4, 1e4, 5e3):
            found = {}
            for sensor in ("motor", "link"):
                found[sensor] = [audit(arm, arm[3], q, damping,
                                       *gear_options(stiffness, damping_ratio, arm[3], sensor))
                                 for arm, q, damping in cases]
            pairs = [(a, b) for without, with_gears in zip(rigid, found["motor"])
                     for a, b in zip(impedance_modes(without), impedance_modes(with_gears))]
            errors = [abs(a["natural_frequency"] / b["natural_frequency"] - 1) for a, b in pairs]
            ratios = [abs(a["damping_ratio"] - b["damping_ratio"]) for a, b in pairs]
            margins = {sensor: [posture["gain_margin"] for posture in found[sensor]] for sensor in found}
            rows.append([f"{stiffness:.0e}".replace("e+0", "e"), f"{damping_ratio:.2f}",
                         f"{100 * statistics.median(errors):.2g} / {100 * max(errors):.2g} %",
                         f"{max(ratios):.2g}", f"{statistics.median(margins['motor']):.3g}",
                         f"{statistics.median(margins['link']):.2g}",
                         f"{sum(margin < 1 for margin in margins['link'])} of {len(cases)}"])
    table(*rows)


def double_diagonalisation(stiffness=1e4):
    print(f"Ratios of the six slow modes on the elastic arm ({stiffness:.0e} N m/rad, motors measured), where "
          f"{RATIO} was meant: least / median / largest of {len(postures(ARMS['Panda']))} postures\n"
          .replace("e+0", "e"))
    rows = [["arm", "what a torque controller leaves of the motors", "designed with the links alone",
             "designed with links and motors"]]
    for name, arm in ARMS.items():
        for share in (1, 0.2):
            inertia = [share * value for value in arm[3]]
            row = [name, f"{100 * share:.0f} %"]
            for known in ([0] * 7, inertia):
                ratios = [mode["damping_ratio"] for q in postures(arm)
                          for mode in impedance_modes(audit(arm, inertia, q, designed(arm, known, q),
                                                            *gear_options(stiffness, 0.01, inertia, "motor")))]
                row.append(f"{min(ratios):.3f} / {statistics.median(ratios):.3f} / {max(ratios):.3f}")
            rows.append(row)
    table(*rows)


def stiff_joints(stiffness=1e4):
    """Joint impedance of 2000 and 300 N m/rad, damped by the diagonal of M."""
    springs = [2000] * 4 + [300] * 3
    errors, ratios = [], []
    for arm in ARMS.values():
        for q in postures(arm):
            options = [*arm_options(arm, arm[3]), "--q", numbers(q)]
            mass = run("inspect", *options)["mass_matrix"]
            dampers = [2 * RATIO * math.sqrt(k * mass[i][i]) for i, k in enumerate(springs)]
            gains = ["--joint-stiffness", numbers(springs), "--joint-damping", numbers(dampers)]
            found = [run("audit", *options, *gains, *more)["posture"]["modes"][-7:]
                     for more in ([], gear_options(stiffness, 0.01, arm[3], "motor"))]
            for a, b in zip(*found):
                errors.append(abs(a["natural_frequency"] / b["natural_frequency"] - 1))
                ratios.append(abs(a["damping_ratio"] - b["damping_ratio"]))
    print(f"Joint springs of 2000 and 300 N m/rad, gears of {stiffness:.0e} N m/rad: frequency error "
          f"{100 * statistics.median(errors):.2g} / {100 * max(errors):.2g} %, ratio error "
          f"{statistics.median(ratios):.2g} / {max(ratios):.2g} (median / worst)\n".replace("e+0", "e"))


def margins(directory):
    arm = ARMS["Panda"]
    q, inertia = arm[4], arm[3]
    damping = designed(arm, inertia, q)
    with open(f"{directory}/elastic.txt", "w", encoding="ascii") as file:
        for step in range(25):
            stiffness = 10 ** (3.5 + step / 10)
            row = [stiffness]
            for damping_ratio in (0.01, 0.05):
                row += [audit(arm, inertia, q, damping, *gear_options(stiffness, damping_ratio, inertia, sensor))
                        ["gain_margin"] for sensor in ("motor", "link")]
            file.write(" ".join(f"{value:.5g}" for value in row) + "\n")


def main():
    rigid_beside_elastic()
    stiff_joints()
    double_diagonalisation()
    margins(sys.argv[2])


if __name__ == "__main__":
    main()

"""Compares what builds print: compare.py REFERENCE OTHER...; each a file of lines KIND NAME NUMBER.
Ends with exit status 1 unless every number agrees with the reference within its kind's tolerance."""

import math
import sys

# kind: (relative, absolute), of the larger of the two
TOLERANCES = {
    "frequency": (1e-12, 0),  # rad/s
    "ratio": (0, 1e-12),
    "tracked_frequency": (1e-10, 0),  # what is followed is refined until it is right to this
    "tracked_ratio": (0, 1e-10),
    "torque": (1e-12, 1e-12),  # N m
    "motion": (0, 1e-12),  # rad, after half a second
    "numerical_motion": (0, 1e-8),  # by a method whose derivatives are numerical: half the digits
}


def read(path):
    with open(path) as file:
        lines = [line.split() for line in file]
    return {name: (kind, float(number)) for kind, name, number in lines}


def compare(reference, other):
    """The largest difference of each kind in units of its tolerance, and the worst name."""
    worst = {}
    if reference.keys() != other.keys():
        return {"names": (math.inf, "other numbers are printed")}
    for name, (kind, number) in reference.items():
        relative, absolute = TOLERANCES[kind]
        difference = abs(number - other[name][1])
        allowed = absolute + relative * max(abs(number), abs(other[name][1]))
        share = 0 if difference == 0 else difference / allowed if allowed else math.inf
        if math.isnan(share) and math.isnan(number) and math.isnan(other[name][1]):
            share = 0
        if not share <= worst.get(kind, (0, ""))[0]:
            worst[kind] = (share, f"{name}: {number!r} and {other[name][1]!r}")
    return worst


def main():
    good = True
    reference = read(sys.argv[1])
    print(f"{len(reference)} numbers of {sys.argv[1]}")
    for path in sys.argv[2:]:
        for kind, (share, what) in compare(reference, read(path)).items():
            verdict = "agrees" if share <= 1 else "DIFFERS"
            good &= share <= 1
            print(f"{path}: {kind} {verdict}, largest {share:.2g} of the tolerance ({what})")
        if read(path) == reference:
            print(f"{path}: the same bits")
    sys.exit(0 if good else 1)


main()

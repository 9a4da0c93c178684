"""Runs an example and compares what it prints with a file: check.py EXPECTED COMMAND...

The file's words have to be there as they are. Its numbers say by their last digit how exact they
are: 9.76 stands for what differs from it by at most 0.01. Lines that begin with # say where the
numbers come from.
"""
import re
import subprocess
import sys

NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def differs(expected, printed):
    """Why a printed line is not the expected one; None if it is."""
    words = [" ".join(NUMBER.sub("#", line).split()) for line in (expected, printed)]
    if words[0] != words[1]:
        return "other words"
    for wanted, found in zip(NUMBER.findall(expected), NUMBER.findall(printed)):
        decimals = len(wanted.partition(".")[2])
        if abs(float(wanted) - float(found)) > (1.001 * 10**-decimals if decimals else 0):
            return f"{found} instead of {wanted}"
    return None


def main(path, *command):
    with open(path, encoding="ascii") as file:
        expected = [line.rstrip() for line in file if not line.startswith("#")]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    printed = done.stdout.splitlines()
    failures = [f"exit status {done.returncode}"] if done.returncode else []
    if len(printed) != len(expected):
        failures.append(f"{len(printed)} lines instead of {len(expected)}")
    for number, pair in enumerate(zip(expected, printed), 1):
        reason = differs(*pair)
        if reason:
            failures.append(f"line {number}: {reason}\n  expected: {pair[0]}\n  printed:  {pair[1]}")
    print(done.stdout, *failures, sep="\n")
    return 1 if failures else 0


sys.exit(main(*sys.argv[1:]))

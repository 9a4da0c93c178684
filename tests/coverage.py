"""Says how much of each library the tests reach: coverage.py SUMMARY, of gcovr --json-summary."""

import json
import sys
from collections import defaultdict

LIBRARIES = ("analysis", "controller", "sim", "lcmtypes", "text", "apps")
GAPS = 12  # files named
LINK = "build/coverage/include/dashpot/"  # the way to headers, see CMakeLists.txt


def share(counts, what):
    total = counts[what + "_total"]
    return f"{100 * counts[what + '_covered'] / total:.1f} %" if total else "-"


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        files = json.load(file)["files"]
    for file in files:
        file["filename"] = file["filename"].removeprefix(LINK)
    libraries = defaultdict(lambda: defaultdict(int))
    for file in files:
        for name in (file["filename"].split("/")[0], "all"):
            for key, value in file.items():
                if key.endswith(("_total", "_covered")):
                    libraries[name][key] += value
    print("| library | lines | covered | branches | covered |\n|---|---|---|---|---|")
    for name in (*LIBRARIES, "all"):
        counts = libraries[name]
        print(
            f"| {name} | {counts['line_total']} | {share(counts, 'line')} "
            f"| {counts['branch_total']} | {share(counts, 'branch')} |"
        )
    print("\nMost lines that no test reaches:")
    missed = [(file["line_total"] - file["line_covered"], file["filename"]) for file in files]
    for count, name in sorted(missed, reverse=True)[:GAPS]:
        if count:
            print(f"{count:5} {name}")


main()

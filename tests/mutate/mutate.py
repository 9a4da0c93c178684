"""Makes small changes to the sources on purpose, and tells which of them the tests notice.

All changes of a sample are compiled into one copy of the tree, build/mutate/src, each behind a
switch of its own (DASHPOT_MUTANT=7 in the environment); every test then tells which it reaches,
and for each change those that reach it are run, the quickest first, until one fails, crashes or
takes five times as long. With --again only the changes that went unnoticed last time are tried.
"""

import argparse
import hashlib
import json
import os
import pickle
import re
from concurrent.futures import ThreadPoolExecutor

import judge
from building import BUILD, ROOT, SOURCE, SUITES, WORK, build_changed, configure, suites_of, units_of
from changes import find, one_line
from rewrite import copy_tree


def arguments():
    parser = argparse.ArgumentParser(prog="run mutate", description=__doc__.split("\n\n")[0])
    parser.add_argument("places", nargs="*", metavar="PLACE", default=["controller"],
                        help="FOLDER, FILE, or FILE:LINE for all that can be changed in that line")
    parser.add_argument("--count", type=int, default=150, help="changes in the sample (150)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (1)")
    parser.add_argument("--slow", type=float, default=10,
                        help="tests that take more seconds than this are left out (10)")
    parser.add_argument("--again", action="store_true",
                        help="the same changes, but only those that went unnoticed last time")
    return parser.parse_args()


def all_changes(folders, commands):
    """What can be changed in the sources of `folders`, as they are in the tree."""
    include = WORK / "parse"
    include.mkdir(exist_ok=True)
    if not (include / "dashpot").is_symlink():
        (include / "dashpot").symlink_to(ROOT)
    files, units = [], []
    for folder in folders:
        own = sorted(str(path.relative_to(ROOT)) for path in (ROOT / folder).rglob("*.[ch]pp")
                     if path.name not in ("compiled_eigen.hpp", "compiled_eigen.cpp"))
        sources = [name for name in own if name.endswith(".cpp")]
        command = commands[units_of(folder, commands)[0]]
        flags = ["-x", "c++", f"-I{include}"]
        for flag, value in zip(command, command[1:]):
            if flag == "-isystem":
                flags += [flag, value]
            elif re.match(r"-(D|std=|march=)", flag):
                flags.append(flag)
        headers = "".join(f"#include <dashpot/{name}>\n" for name in own if name.endswith(".hpp"))
        units.append((f"{folder}.cpp", headers, flags))
        units += [(str(include / "dashpot" / name), None, flags) for name in sources]
        files += own
    return remembered(files, lambda: find(files, str(include / "dashpot"), units))


def remembered(files, find_them):
    """What `find_them` finds, unless it is known from the last time for the same files."""
    known, state = WORK / "changes.pickle", hashlib.sha256()
    for path in [*files, "tests/mutate/changes.py"]:
        state.update((path + "\n").encode() + (ROOT / path).read_bytes())
    if known.exists():
        before, changes = pickle.loads(known.read_bytes())
        if before == state.hexdigest():
            return changes
    changes = find_them()
    known.write_bytes(pickle.dumps((state.hexdigest(), changes)))
    return changes


def rank(seed, *key):
    return hashlib.sha256(repr((seed,) + key).encode()).hexdigest()


def sample(changes, places, count, seed):
    """All in the lines that are named; of the rest `count` lines, with one change in each."""
    wanted = {tuple(place.rsplit(":", 1)) for place in places if ":" in place}
    chosen = [change for change in changes if (change.file, str(change.line)) in wanted]
    others = [place.rstrip("/") for place in places if ":" not in place]
    lines = {}
    for change in changes:
        if any((change.file + "/").startswith(other + "/") for other in others):
            lines.setdefault((change.file, change.line), []).append(change)
    texts, ranked = {}, []
    for (file, line), here in sorted(lines.items()):
        if file not in texts:
            texts[file] = (ROOT / file).read_text().split("\n")
        text = texts[file][line - 1].strip()
        nth = [other.strip() for other in texts[file][:line]].count(text)
        key = rank(seed, file, text, nth)
        # First a kind of change, so that a rare one is not lost among many.
        best = min(here, key=lambda change: (rank(key, change.operator),
                                             rank(key, change.old, change.new)))
        ranked.append((key, best))
    chosen += [change for _, change in sorted(ranked, key=lambda pair: pair[0])[:count]]
    return sorted(set(chosen),
                  key=lambda change: (change.file, change.begin, -change.end, change.new))


def named(change):
    """A change as tests/mutate/equivalent.txt names it, wherever its line is."""
    line = (ROOT / change.file).read_text().split("\n")[change.line - 1]
    return (f"{change.file}: {one_line(line)}",
            f"{change.operator}: {change.old} -> {change.new or '(nothing)'}")


def reviewed():
    """Why a change makes no difference that a test could see, by its name."""
    text = (ROOT / "tests/mutate/equivalent.txt").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    changes = [line.split(" // ") for line in lines[1::2]]
    return {(line, change): why for line, (change, why) in zip(lines[::2], changes)}


def judge_all(changes, tests, before):
    """A verdict for each change: noticed (by what), UNNOTICED, UNREACHED or equivalent (why)."""
    known = reviewed()

    def verdict(number, change):
        if named(change) in known:
            return "equivalent: " + known[named(change)]
        last = before.get((f"{change.file}:{change.line}", *named(change)), "")
        if last.startswith("noticed"):
            return last
        if not any(number in test.reached for test in tests):
            return "UNREACHED"
        found = judge.noticed(number, tests)
        if not found:
            print(f"\n{change.file}:{change.line}: {named(change)[1]}: UNNOTICED", flush=True)
            return "UNNOTICED"
        print(".", end="", flush=True)
        return f"noticed: {found[0]} {found[1]}"

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        verdicts = list(pool.map(verdict, range(1, len(changes) + 1), changes))
    print()
    return verdicts


def report(results, slow):
    for row in results:
        print(f"{row['number']:4} {row['place']}: {row['name'][1]}\n     {row['verdict']}")

    def count(kind):
        return sum(row["verdict"].startswith(kind) for row in results)

    judged = len(results) - count("equivalent")
    print(f"\n{count('noticed')} of {judged} changes noticed "
          f"({100 * count('noticed') / max(judged, 1):.1f} %), {count('UNNOTICED')} unnoticed, "
          f"{count('UNREACHED')} reached by no test; {count('equivalent')} make no difference "
          f"(tests/mutate/equivalent.txt)")
    if slow:
        print(f"Left out as slow: {', '.join(sorted(test.name for test in slow))}")


def main():
    options = arguments()
    folders = sorted({place.split("/")[0] for place in options.places})
    unknown = [folder for folder in folders if folder not in SUITES]
    if unknown:
        raise SystemExit(f"mutate: no folder {unknown[0]}; there are {', '.join(SUITES)}")
    if not SOURCE.exists():
        copy_tree(ROOT, SOURCE, [])
    commands = configure()
    print("Looking for what can be changed", flush=True)
    drawn = sample(all_changes(folders, commands), options.places, options.count, options.seed)
    changes = build_changed(drawn, folders, commands)
    print("Running each test with no change in force", flush=True)
    tests = judge.list_tests(BUILD, suites_of(folders))
    failures = judge.explore(tests, os.cpu_count())
    if failures:
        raise SystemExit("mutate: " + "\n".join(failures))
    results_path, before = WORK / "results.json", {}
    if options.again:
        before = {(row["place"], *row["name"]): row["verdict"]
                  for row in json.loads(results_path.read_text())}
    quick = [test for test in tests if test.seconds <= options.slow]
    verdicts = judge_all(changes, quick, before)
    results = [{"number": number, "place": f"{change.file}:{change.line}", "name": named(change),
                "verdict": verdict}
               for number, (change, verdict) in enumerate(zip(changes, verdicts), 1)]
    results_path.write_text(json.dumps(results, indent=1) + "\n")
    report(results, [test for test in tests if test not in quick and test.reached])
    print(f"Wrote {results_path.relative_to(ROOT)}")


if __name__ == "__main__":
    main()

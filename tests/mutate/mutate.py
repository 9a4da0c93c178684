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
import shlex
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import judge
from changes import find, one_line
from rewrite import copy_tree

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "build/mutate"
SOURCE = WORK / "src"
BUILD = SOURCE / "build/release"  # so that ccache knows what is as in the tree
# The programs with tests that could notice what changes in a folder.
SUITES = {
    "analysis": ["analysis", "controller", "sim"],
    "controller": ["controller", "plugin", "sim", "threads"],
    "sim": ["sim", "threads", "apps"],
    "lcmtypes": ["lcmtypes", "threads", "apps"],
}


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


def configure():
    subprocess.run(["cmake", "--preset", "release", "-DDASHPOT_WARNINGS_AS_ERRORS=OFF"],
                   cwd=SOURCE, check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", BUILD, "--target", "dashpot_messages"],
                   check=True, stdout=subprocess.DEVNULL)
    with open(BUILD / "compile_commands.json") as file:
        return {str(Path(entry["file"]).relative_to(SOURCE)): shlex.split(entry["command"])
                for entry in json.load(file) if entry["file"].startswith(str(SOURCE))}


def all_changes(folders, commands):
    """What can be changed in the sources of `folders`, as they are in the tree."""
    include = WORK / "parse"
    include.mkdir(exist_ok=True)
    if not (include / "dashpot").is_symlink():
        (include / "dashpot").symlink_to(ROOT)
    files, units = [], []
    for folder in folders:
        own = sorted(str(path.relative_to(ROOT)) for path in (ROOT / folder).glob("*.[ch]pp")
                     if path.name not in ("compiled_eigen.hpp", "compiled_eigen.cpp"))
        sources = [name for name in own if name in commands]
        command = commands[sources[0]]
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
        if change.file in others or change.file.split("/")[0] in others:
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


def to_blame(output, changes):
    """The changes in lines that the compiler complains of."""
    lines = set(re.findall(r"([\w/.]+):(\d+):\d*", output))
    lines = {(os.path.relpath(file, ROOT), int(line)) for file, line in lines
             if file.startswith(str(ROOT))}
    blamed = set()
    for change in changes:
        last = change.line + (ROOT / change.file).read_bytes()[change.begin:change.end].count(b"\n")
        if any((change.file, line) in lines for line in range(change.line, last + 1)):
            blamed.add(change)
    return blamed


def errors_in(output):
    """Of what a compiler prints the errors, each with where it comes from, without the warnings."""
    errors, before = [], []
    for line in output.split("\n"):
        if " warning: " in line:
            before = []
        elif "error: " in line:
            errors += [*before, line]
            before = []
        else:
            before.append(line)
    return "\n".join(errors)


def compile_errors(command):
    """What the compiler has against a file; empty if nothing."""
    command = command[:command.index("-o")] + ["-fsyntax-only", command[-1]]
    done = subprocess.run(command, cwd=BUILD, capture_output=True, text=True)
    return errors_in(done.stderr) or done.stderr if done.returncode else ""


def misfits(blamed=()):
    """Changes that are known not to compile, with those to be remembered now."""
    file = WORK / "misfits.json"
    known = set(json.loads(file.read_text())) if file.exists() else set()
    known |= {repr(change) for change in blamed}
    file.write_text(json.dumps(sorted(known)))
    return known


def without_misfits(changes, folders, commands):
    """The changes that compile in the libraries; leaves the copy of the tree as they make it."""
    known = misfits()
    changes = [change for change in changes if repr(change) not in known]
    checked = WORK / "checked"  # there while all that was written has been
    if any(name.split("/")[0] in SUITES
           for name in copy_tree(ROOT, SOURCE, list(enumerate(changes, 1)))):
        checked.unlink(missing_ok=True)
    if checked.exists():
        return changes
    alike = {re.sub(r"\d", "", name): name for name in commands if name.split("/")[0] in folders}
    unchecked = list(alike.values())  # one of those that instantiate the same for other sizes
    precompiled = {os.path.relpath(word, BUILD) + ".gch" for name in unchecked
                   for word in commands[name] if word.endswith("cmake_pch.hxx")}
    subprocess.run(["cmake", "--build", BUILD, "--target", *precompiled],
                   check=True, stdout=subprocess.DEVNULL)
    while unchecked:
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            errors = list(pool.map(lambda name: compile_errors(commands[name]), unchecked))
        blamed = set().union(*(to_blame(text, changes) for text in errors))
        if any(errors) and not blamed:
            raise SystemExit("mutate: does not compile:\n" + "".join(errors)[:3000])
        misfits(blamed)
        changes = [change for change in changes if change not in blamed]
        copy_tree(ROOT, SOURCE, list(enumerate(changes, 1)))
        unchecked = [name for name, text in zip(unchecked, errors) if text]
    checked.touch()
    return changes


def build(folders):
    """Builds the tests; returns what the compiler complains of, empty if of nothing."""
    suites = sorted({suite for folder in folders for suite in SUITES[folder]})
    targets = [f"{suite}_tests" for suite in suites] + ["plugin_host"] * ("plugin" in suites)
    command = ["cmake", "--build", BUILD, "--parallel", str(os.cpu_count()), "--target", *targets]
    with open(WORK / "build.log", "w") as log:  # changed code makes many warnings
        done = subprocess.run(command, stdout=log, stderr=subprocess.STDOUT)
    if done.returncode == 0:
        return ""
    return errors_in((WORK / "build.log").read_text()) or str(WORK / "build.log")


def build_changed(drawn, folders, commands):
    """Builds the tests with those of the changes that compile, and returns these."""
    while True:
        changes = without_misfits(drawn, folders, commands)
        print(f"{len(changes)} changes ({len(drawn) - len(changes)} more do not compile)",
              flush=True)
        errors = build(folders)
        if not errors:
            return changes
        blamed = to_blame(errors, changes)  # what is instantiated by tests alone
        if not blamed:
            raise SystemExit("mutate: the build fails:\n" + errors[:3000])
        misfits(blamed)


def named(change):
    """A change as tests/mutate/equivalent.txt names it, wherever its line is."""
    line = (ROOT / change.file).read_text().split("\n")[change.line - 1]
    return (f"{change.file}: {one_line(line)}",
            f"{change.operator}: {change.old} -> {change.new or '(nothing)'}")


def reviewed():
    """Why a change makes no difference that a test could see, by its name."""
    text = (ROOT / "tests/mutate/equivalent.txt").read_text()
    blocks = [block.split("\n") for block in text.split("\n\n")]
    return {tuple(block[:2]): " ".join(block[2:]).strip() for block in blocks
            if len(block) > 2 and not block[0].startswith("#")}


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
        print("." if found else "!", end="", flush=True)
        return f"noticed: {found[0]} {found[1]}" if found else "UNNOTICED"

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
    tests = judge.list_tests(BUILD)
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

"""Compiles the changed copy of the tree, without those changes that do not compile."""

import json
import os
import re
import shlex
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from rewrite import copy_tree

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "build/mutate"
SOURCE = WORK / "src"
BUILD = SOURCE / "build/release"  # so that ccache knows what is as in the tree
# The programs with tests that could notice what changes in a folder.
SUITES = {
    "analysis": ["analysis", "identification", "controller", "sim"],
    "identification": ["identification", "apps"],
    "controller": ["controller", "plugin", "sim", "threads"],
    "sim": ["sim", "threads", "apps"],
    "lcmtypes": ["lcmtypes", "plugin", "threads", "apps"],
}


def configure():
    subprocess.run(["cmake", "--preset", "release", "-DDASHPOT_WARNINGS_AS_ERRORS=OFF"],
                   cwd=SOURCE, check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", BUILD, "--target", "dashpot_messages"],
                   check=True, stdout=subprocess.DEVNULL)
    with open(BUILD / "compile_commands.json") as file:
        return {str(Path(entry["file"]).relative_to(SOURCE)): shlex.split(entry["command"])
                for entry in reversed(json.load(file))  # the library's, where tests have it too
                if entry["file"].startswith(str(SOURCE))}


def units_of(folder, commands):
    """What is compiled for a folder: some of its sources by themselves, others many at a time."""
    return [name for name in commands
            if name.startswith((f"{folder}/", f"build/release/{folder}/"))
            and not name.endswith("cmake_pch.hxx.cxx")]


def to_blame(output, changes):
    """The changes in lines that the compiler complains of."""
    lines = set(re.findall(r"([^\s:]+):(\d+):\d*", output))
    lines = {(os.path.relpath(file, ROOT), int(line)) for file, line in lines
             if file.startswith(str(ROOT))}
    blamed = set()
    for change in changes:
        last = change.line + (ROOT / change.file).read_bytes()[change.begin:change.end].count(b"\n")
        if any((change.file, line) in lines for line in range(change.line, last + 1)):
            blamed.add(change)
    return blamed


def errors_in(output):
    """Of what a compiler prints the errors, with where they come from and notes, no warnings."""
    errors, before, relevant = [], [], False
    for line in output.split("\n"):
        if " warning: " in line or " error: " in line:
            relevant = " error: " in line
            errors += [*before, line] if relevant else []
            before = []
        elif relevant and " note: " in line:
            errors.append(line)
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


def without_blamed(changes, complaints):
    """The changes that no complaint of the compiler names; the others are left out of the copy, too."""
    blamed = set().union(*(to_blame(text, changes) for text in complaints))
    if not blamed:
        raise SystemExit("mutate: does not compile:\n" + "".join(complaints)[:3000])
    misfits(blamed)
    changes = [change for change in changes if change not in blamed]
    copy_tree(ROOT, SOURCE, list(enumerate(changes, 1)))
    return changes


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
    unchecked = [name for folder in folders for name in units_of(folder, commands)]
    precompiled = {os.path.relpath(word, BUILD) for name in unchecked
                   for word in commands[name] if word.endswith("cmake_pch.hxx.pch")}
    while complaint := build(precompiled):
        changes = without_blamed(changes, [complaint])
    while unchecked:
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            errors = list(pool.map(lambda name: compile_errors(commands[name]), unchecked))
        if any(errors):
            changes = without_blamed(changes, errors)
        unchecked = [name for name, text in zip(unchecked, errors) if text]
    checked.touch()
    return changes


def suites_of(folders):
    return sorted({suite for folder in folders for suite in SUITES[folder]})


def build(targets):
    """Builds the targets; returns what the compiler complains of, empty if of nothing."""
    command = ["cmake", "--build", BUILD, "--parallel", str(os.cpu_count()), "--target", *targets]
    with open(WORK / "build.log", "w") as log:  # changed code makes many warnings
        done = subprocess.run(command, stdout=log, stderr=subprocess.STDOUT)
    if done.returncode == 0:
        return ""
    return errors_in((WORK / "build.log").read_text()) or str(WORK / "build.log")


def build_changed(drawn, folders, commands):
    """Builds the tests with the changes that compile, and returns these changes."""
    while True:
        changes = without_misfits(drawn, folders, commands)
        print(f"{len(changes)} changes ({len(drawn) - len(changes)} more do not compile)",
              flush=True)
        complaint = build(f"{suite}_tests" for suite in suites_of(folders))
        if not complaint:
            return changes
        without_blamed(changes, [complaint])  # what is instantiated by tests alone

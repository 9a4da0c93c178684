"""What callgrind saw of single control ticks, by the part of the library that ran:
    footprint.py BUILD FILE...
reads callgrind's dumps of tick_bench's `footprint`, which began with empty and practically
unlimited caches, so that each line of memory was missed once; prints Google Benchmark's rows with
the instructions, the lines of code and the lines of data (64 bytes each) of a tick, and of its
parts: the folders whose object files in BUILD hold the functions."""

import collections
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).parent.parent
LIBRARIES = ("analysis", "controller")
COUNTS = {"instructions": ("Ir",), "code_lines": ("I1mr",), "data_lines": ("D1mr", "D1mw")}


def folders_of_functions(build):
    """The folder of the source file that a function was compiled from, by mangled name."""
    folders = {}
    for library in LIBRARIES:
        sources = {path.name: path.parent.relative_to(ROOT).as_posix()
                   for path in (ROOT / library).rglob("*.cpp")}
        archive = pathlib.Path(build) / library / f"libdashpot_{library}.a"
        listed = subprocess.run(["nm", "-A", "--defined-only", archive],
                                check=True, capture_output=True, text=True).stdout
        for line in listed.splitlines():
            member, _, rest = line.removeprefix(f"{archive}:").partition(":")
            folders.setdefault(rest.split()[-1], sources.get(member.removesuffix(".o")))
    return folders


def costs(text):
    """(function, {event: count}) of each line of costs that is a function's own."""
    names, function, events, skip = {}, None, [], False
    for line in text.splitlines():
        if line.startswith("events: "):
            events = line.split()[1:]
        elif line.startswith("fn="):
            number, name = re.match(r"fn=(\(\d+\)) ?(.*)", line).groups()
            function = names.setdefault(number, name)
        elif line.startswith("cfn="):
            number, name = re.match(r"cfn=(\(\d+\)) ?(.*)", line).groups()
            if name:
                names[number] = name
        elif line.startswith("calls="):
            skip = True  # the next line is what the callee and all below it cost
        elif re.match(r"[+\-*\d]", line):
            if not skip and function is not None:
                yield function, dict(zip(events, map(int, line.split()[1:])))
            skip = False


def counted(event_counts):
    return {what: sum(event_counts.get(event, 0) for event in events)
            for what, events in COUNTS.items()}


def row(text, folders):
    parts = collections.defaultdict(collections.Counter)
    for function, events in costs(text):
        plain = re.sub(r"'\d+$", "", function)  # callgrind numbers the levels of a recursion
        parts[folders.get(plain) or "other"].update(counted(events))
    total = sum(parts.values(), collections.Counter())
    name = re.search(r"Client Request: (\S+)", text)[1]
    return {"name": f"footprint/{name}", "run_type": "iteration", "iterations": 1, **total,
            "parts": {part: dict(counts) for part, counts in sorted(parts.items())}}


def main():
    folders = folders_of_functions(sys.argv[1])
    rows = [row(pathlib.Path(name).read_text(), folders) for name in sys.argv[2:]]
    print(json.dumps({"context": {}, "benchmarks": rows}, indent=1))


main()

"""Counts of callgrind in single control ticks, by the part of the library that ran:
    footprint.py FILE...
reads callgrind's dumps of tick_bench's `footprint`, which began with empty and practically
unlimited caches, so that each line of memory was missed once; prints Google Benchmark's rows with
the instructions, the lines of code and the lines of data (64 bytes each) of a tick, and of its
parts: the namespaces of the functions."""

import collections
import json
import pathlib
import re
import sys

COUNTS = {"instructions": ("Ir",), "code_lines": ("I1mr",), "data_lines": ("D1mr", "D1mw")}


def part_of(function):
    """Whose a function is, by the namespace in its mangled name. Eigen's are instances of its templates
    that were not made part of their callers."""
    namespace = re.match(r"_Z+NK?(?:7dashpot\d+(analysis|identification|controller)|5(Eigen))", function)
    return next(filter(None, namespace.groups())) if namespace else "other"


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
            skip = True  # the next line is the cost of the callee and all below it
        elif re.match(r"[+\-*\d]", line):
            if not skip and function is not None:
                yield function, dict(zip(events, map(int, line.split()[1:])))
            skip = False


def counted(event_counts):
    return {what: sum(event_counts.get(event, 0) for event in events)
            for what, events in COUNTS.items()}


def row(text):
    parts = collections.defaultdict(collections.Counter)
    for function, events in costs(text):
        parts[part_of(function)].update(counted(events))
    total = sum(parts.values(), collections.Counter())
    name = re.search(r"Client Request: (\S+)", text)[1]
    return {"name": f"footprint/{name}", "run_type": "iteration", "iterations": 1, **total,
            "parts": {part: dict(counts) for part, counts in sorted(parts.items())}}


def main():
    rows = [row(pathlib.Path(name).read_text()) for name in sys.argv[1:]]
    print(json.dumps({"context": {}, "benchmarks": rows}, indent=1))


main()

"""Runs the tests that reach a change with the change in force."""

import json
import os
import re
import subprocess
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

SKIPPED = 77  # exit status of a test by a script, as CTest knows it


@dataclass
class Test:
    name: str
    command: list
    folder: str
    filter: str  # of a program by GoogleTest; else empty
    seconds: float = 0  # of the processor, by itself
    reached: set = field(default_factory=set)


def list_tests(build, suites):
    """What ctest knows of in these suites: programs of others may be there from another sample,
    whose changes have the same numbers."""
    text = subprocess.run(["ctest", "--test-dir", build, "--show-only=json-v1"], check=True,
                          capture_output=True, text=True).stdout
    tests = []
    for entry in json.loads(text)["tests"]:
        command = entry.get("command")
        if entry["name"].split("/")[0] not in suites:
            continue
        if not command or not all(os.path.exists(part) for part in command
                                  if part == command[0] or part.startswith(str(build))):
            continue  # not built
        folder = {p["name"]: p["value"] for p in entry["properties"]}["WORKING_DIRECTORY"]
        chosen = [a.split("=", 1)[1] for a in command if a.startswith("--gtest_filter=")]
        tests.append(Test(entry["name"], command, folder, chosen[0] if chosen else ""))
    return tests


def run(command, folder, seconds, settings):
    """(exit status, output, seconds of the processor); stopped after `seconds` of the processor,
    or twenty times as long by the clock."""
    environment = dict(os.environ, **settings)
    limited = ["prlimit", f"--cpu={int(seconds) + 1}", "--core=0", "--"] + command
    with tempfile.TemporaryFile() as output:
        before = time.monotonic()
        process = subprocess.Popen(limited, cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                                   stdout=output, stderr=subprocess.STDOUT, start_new_session=True)
        usage = None
        while usage is None:
            done, status, usage = os.wait4(process.pid, os.WNOHANG)
            if done:
                break
            usage = None
            if time.monotonic() - before > 60 + 20 * seconds:
                os.killpg(process.pid, 9)
                _, status, usage = os.wait4(process.pid, 0)
                break
            time.sleep(0.005)
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        text = output.read().decode(errors="replace")
    return process.returncode, text, usage.ru_utime + usage.ru_stime


def explore(tests, jobs):
    """Runs each test by itself with no change in force: how long it takes and what it reaches."""
    def one(test):
        with tempfile.TemporaryDirectory() as scratch:
            path = f"{scratch}/reached"
            status, output, test.seconds = run(test.command, test.folder, 600,
                                               {"DASHPOT_MUTANTS_REACHED": path})
            if status == SKIPPED:
                return None
            if status != 0:
                return f"{test.name} fails with no change made:\n{output[-2000:]}"
            if os.path.exists(path):
                with open(path) as file:
                    test.reached = {int(line) for line in file}
        return None

    with ThreadPoolExecutor(jobs) as pool:
        failures = [failure for failure in pool.map(one, tests) if failure]
    return failures


def rounds(tests):
    """Lists of tests to run together, the quickest first."""
    together, seconds, most = [], 0, 1
    for test in sorted(tests, key=lambda test: test.seconds):
        together.append(test)
        seconds += test.seconds
        if seconds > most:
            yield together
            together, seconds, most = [], 0, 3 * most
    if together:
        yield together


def processes(tests):
    """The tests of a program in one process: (command, folder, seconds)."""
    programs = {}
    for test in tests:
        key = test.command[0] if test.filter else test.name
        programs.setdefault(key, []).append(test)
    for group in programs.values():
        command = group[0].command
        if group[0].filter:
            command = [command[0], "--gtest_filter=" + ":".join(test.filter for test in group),
                       "--gtest_also_run_disabled_tests", "--gtest_fail_fast"]
        yield command, group[0].folder, sum(test.seconds for test in group), group[0].name


def noticed(number, tests):
    """The test that notices the change, and how; None if none does."""
    for together in rounds([test for test in tests if number in test.reached]):
        for command, folder, seconds, name in processes(together):
            status, output, _ = run(command, folder, 10 + 5 * seconds,
                                    {"DASHPOT_MUTANT": str(number)})
            if status != 0:
                suite = name.split("/")[0]
                begun = re.findall(r"\[ RUN      \] (\S+)", output)
                failed = re.findall(r"\[  FAILED  \] ([^\s,]+)", output)
                how = "fails" if status > 0 else "stops" if status in (-9, -24) else "crashes"
                which = failed or begun[-1:]
                return (f"{suite}/{which[0]}" if which else name), how
    return None

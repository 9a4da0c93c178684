"""What others rely on, compared with interface.txt: docs/stability.md says what is promised of it.

interface.py PROGRAM SOURCE [--write]: PROGRAM is dashpot in its build folder, SOURCE the tree.
"""

import ast
import difflib
import itertools
import json
import math
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile

PROGRAM, SOURCE = (pathlib.Path(name).resolve() for name in sys.argv[1:3])
BUILD = PROGRAM.parent
PANDA = ["--urdf", SOURCE / "sim/models/panda.urdf", "--base", "panda_link0",
         "--tip", "panda_hand_tcp"]
SCENE = SOURCE / "sim/scenes/panda_push_held.yaml"


def run(*command, text=None):
    return subprocess.run([PROGRAM, *command], input=text, text=True, check=False, capture_output=True)


def symbols(library):
    """Returns the functions that a shared library shows."""
    lines = subprocess.run(["nm", "-D", "--defined-only", BUILD / library], check=True, text=True,
                           stdout=subprocess.PIPE).stdout.splitlines()
    return f"{library}: {', '.join(sorted(line.split()[-1] for line in lines))}"


def declarations(header):
    """Yields the declarations of a C header, each on one line, without comments."""
    text = re.sub(r"/\*.*?\*/", "", (SOURCE / header).read_text(encoding="utf-8"), flags=re.DOTALL)
    yield from re.findall(r"^#define \w+ .+?$", text, re.MULTILINE)
    text = re.sub(r"^#.*$|^extern \"C\" \{$|^\}$", "", text, flags=re.MULTILINE)
    for part in re.findall(r"[^{};]*(?:\{[^}]*\}[^;]*)?;", text):
        yield " ".join(part.split())


def messages():
    """Yields the fingerprint of each message, as lcm-gen computes it."""
    for path in sorted((BUILD / "generated/dashpot/lcmtypes").glob("*.hpp")):
        found = re.search(r"uint64_t hash = (0x[0-9a-f]+)", path.read_text(encoding="utf-8"))
        if found:  # what is sent is turned by one bit
            turned = int(found[1], 16) << 1
            yield f"{path.stem} 0x{turned % 2**64 | turned >> 64:016x}"


def options():
    """Yields each option with its value and default and the subcommands that have it, and the exit status."""
    text = run("--help").stdout
    yield " ".join(text[text.index("Exit status"):].split())
    names = re.findall(r"^  ([a-z-]+(?:, [a-z-]+)*)  ", text.split("Subcommands:")[1], re.MULTILINE)
    commands = {}
    for name in names:
        text = run(name.split(",")[0], "--help").stdout
        for section in ("Positionals:", "Options:"):
            lines = text.partition(section)[2].partition("\n\n")[0].splitlines()
            for line in filter(re.compile("  [^ ]").match, lines):
                option = re.split(r"  +|(?<=[])]) (?=[A-Z])", line[2:])[0]
                commands.setdefault(option, []).append(name)
    yield from (f"{option}: {'; '.join(names)}" for option, names in commands.items())


def by_place(keys):
    """Yields the keys of each place in one line."""
    names = {}
    for key in keys:
        place, _, name = key.rpartition(".")
        names.setdefault(place, []).append(name)
    yield from (f"{place}: {', '.join(found)}" for place, found in names.items())


def known_keys(check, document, place):
    """Yields the keys at a place of a document, with the keys below them, as its errors list them."""
    for in_list in (False, True):
        root = json.loads(json.dumps(document))
        node = root
        for key, is_list in place[:-1]:
            node = node.setdefault(key, [{}] if is_list else {})
            node = node[0] if isinstance(node, list) else node
        wrong = {"no_such_key": 1}
        if place:
            node[place[-1]] = [wrong] if in_list else wrong
        else:
            node.update(wrong)
        found = re.search(r"no_such_key: unknown key; the keys are (.*?)(?: \(line \d+\))?$",
                          check(json.dumps(root)), re.MULTILINE)
        if found:
            path = "".join(f"{key}{'[]' if is_list else ''}." for key, is_list in place[:-1])
            path += "" if not place else place[-1] + ("[]." if in_list else ".")
            above = [*place[:-1], (place[-1], in_list)] if place else []
            for key in found[1].split(", "):
                yield path + key
                yield from known_keys(check, document, [*above, key])
            return


def yaml_keys(folder):
    """Yields the keys of configurations and scenes, and of the systems of `dashpot analyze`."""
    def check_scene(text):
        path = folder / "scene.yaml"
        path.write_text(text, encoding="utf-8")
        return run("run", path, "--fast", "--duration", "0.001").stderr

    def check_system(text):
        return run("analyze", "-", text=text).stderr

    arm = {"robot": {"urdf": str(SOURCE / "sim/models/panda.urdf"), "base": "panda_link0",
                     "tip": "panda_hand_tcp"}, "scenario": {
               "duration": 0.001, "start": {"position": [0, -0.8, 0, -2.4, 0, 1.6, 0.8]},
               "steps": [{"at": 0}]}}
    yield from (f"arm.{key}" for key in known_keys(check_scene, arm, []))
    yield from (f"analyze.{key}" for key in known_keys(check_system, {"mass": [[1]]}, []))


def check_examples(keys):
    """Ends the program if an example lacks a key: of configurations, or of what only scenes have."""
    examples = [(SOURCE / name).read_text(encoding="utf-8")
                for name in ("controller/examples/panda.yaml", "sim/scenes/panda.yaml")]
    for key in keys:
        place, _, name = key.rpartition(".")
        of_scene = place.startswith(("arm.simulation", "arm.scenario", "arm.commands")) and ".gains" not in place
        if place.startswith("arm") and not re.search(rf"(^|[\s{{#]){name}:", examples[of_scene]):
            sys.exit(f"the example of {'scenes' if of_scene else 'configurations'} does not show {key}")


def paths_of(value, path=""):
    """Yields the place of each key in a JSON value; numbers and texts as keys are counted as one."""
    if isinstance(value, list):
        for item in value:
            yield from paths_of(item, path + "[]")
    elif isinstance(value, dict):
        for key, item in value.items():
            name = key if re.fullmatch(r"\w+", key) else "TEXT"
            yield f"{path}.{name}"
            yield from paths_of(item, f"{path}.{name}")


def interrupted_drive(folder):
    """Returns what `dashpot drive` prints without a driver, ended by Ctrl-C."""
    with subprocess.Popen(
            [PROGRAM, "drive", SOURCE / "controller/examples/panda_drive.yaml", "--panda",
             "--dry-run", "--json", "--lcm-url", "memq://"], text=True, cwd=folder,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stderr.readline()  # it waits for a status
        process.send_signal(signal.SIGINT)
        return process.communicate()[0]


def write_records(folder):
    """Writes a decay of two channels, and a motion of the Panda with torques that are not its own."""
    decay, motion = folder / "decay.csv", folder / "motion.csv"
    lines = ["time [s],q1 [rad],q2 [rad]"]
    for i in range(600):
        x, y = (0.02 * math.exp(-w * i / 1500) * math.cos(w * i / 200) for w in (9, 14))
        lines.append(f"{i / 200},{x + y / 2:.9f},{x / 2 - y:.9f}")
    decay.write_text("\n".join(lines) + "\n", encoding="utf-8")
    joints = range(1, 8)
    lines = [",".join(["time [s]", *(f"q{j} [rad]" for j in joints),
                       *(f"torque{j} [N m]" for j in joints)])]
    for i in range(800):
        waves = [math.sin(i / 100 * (0.7 + 0.13 * j) + j) for j in joints]
        lines.append(",".join([f"{i / 100}", *(f"{0.3 * x - (1.5 if j == 4 else 0):.7f}"
                                               for j, x in zip(joints, waves)),
                               *(f"{5 * x:.7f}" for x in waves)]))
    motion.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return decay, motion


def json_keys(folder):
    """Yields the keys of each command's JSON."""
    decay, motion = write_records(folder)
    log, system = folder / "run.lcm", SOURCE / "apps/examples/chain3_impulse.yaml"
    gains = [*PANDA, "--stiffness", "400,400,400,20,20,20"]
    period = ["--period", "1ms"]
    commands = [
        ["analyze", system], ["inspect", *PANDA], ["inspect", *PANDA, "--drives", "panda"],
        ["audit", *gains, "--damping-factor", "2", *period, "--samples", "2", "--drives", "panda"],
        ["audit", *gains, "--damping-factor", "2", *period],
        ["design", *gains, "--damping-ratio", "0.7", *period],
        ["design", *gains, "--damping-ratio", "0.7", "--region", "--samples", "2"],
        ["run", SCENE, "--fast", "--duration", "0.5", "--log", log],
        ["identify", decay], ["identify", log, "--against", SCENE],
        ["check-model", motion, "--config", SCENE]]
    answers = [(command[0], run(*command, "--json")) for command in commands]
    texts = [(name, answer.stdout or sys.exit(f"dashpot {name}: {answer.stderr}"))
             for name, answer in answers] + [("drive", interrupted_drive(folder))]
    keys = {f"{name}{path}" for name, text in texts for path in paths_of(json.loads(text))}
    yield from sorted(keys)


def signature(name, node):
    result = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    return f"{name}({ast.unparse(node.args)}){result}"


def members(part):
    """Yields what a statement in a class adds to it, without what begins with an underscore."""
    if isinstance(part, ast.FunctionDef):
        if part.name == "__init__" or part.name[0] != "_":
            kind = "".join(f"@{ast.unparse(mark)} " for mark in part.decorator_list)
            yield f"  {kind}{signature(part.name, part)}"
        inner = part.body if part.name == "__init__" else []
        texts = [ast.unparse(line) for line in inner if isinstance(line, ast.AnnAssign)]
        yield from (f"  {text.split(' =')[0]}" for text in texts if text.startswith("self.")
                    and not text.startswith("self._"))
    elif isinstance(part, (ast.Assign, ast.AnnAssign)):
        yield "  " + " ".join(ast.unparse(part).split())


def python_names():
    """Yields what the package shows: functions with their arguments, classes with their members."""
    folder = SOURCE / "python/dashpot"
    modules = {path.stem: ast.parse(path.read_text(encoding="utf-8"))
               for path in [*folder.glob("*.py"), folder / "_core.pyi"]}
    names = [(part.module, name.name) for part in modules["__init__"].body
             if isinstance(part, ast.ImportFrom) and part.level
             for name in part.names if not name.asname]
    names += [(module, node.name) for module in ("franka", "ros") for node in modules[module].body
              if isinstance(node, (ast.FunctionDef, ast.ClassDef))]
    for module, name in sorted(names, key=lambda pair: (pair[0][0] != "_", pair[1])):
        if name.startswith("_"):
            continue
        prefix = "dashpot." if module.startswith("_") else f"dashpot.{module}."
        node = next(node for node in modules[module].body if getattr(node, "name", "") == name)
        if isinstance(node, ast.FunctionDef):
            yield prefix + signature(name, node)
            continue
        yield f"{prefix}{name}({', '.join(ast.unparse(base) for base in node.bases)})"
        lines = itertools.chain.from_iterable(members(part) for part in node.body)
        for called, group in itertools.groupby(lines, key=lambda line: "(" in line):
            listed = list(group)
            yield from listed if called else ["  " + ";".join(listed).replace(";  ", "; ").strip()]
    for module in ("franka", "ros"):
        text = (folder / f"{module}.py").read_text(encoding="utf-8")
        names = re.findall(r'add_argument\("([\w-]+)"', text)
        yield f"python -m dashpot.{module} {', '.join(names)}"


def interface():
    """Returns the list, section by section."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        os.chdir(folder)
        keys = list(yaml_keys(folder))
        check_examples(keys)
        sections = {
            "Functions of the shared libraries": [symbols("libdashpot_plugin.so"),
                                                  symbols("libdashpot_publisher.so")],
            "C headers": [*declarations("controller/plugin.h"),
                          *declarations("lcmtypes/plugin_publisher.h")],
            "LCM messages": messages(), "Command line": options(),
            "YAML keys": by_place(keys), "JSON keys": by_place(json_keys(folder)),
            "Python": python_names()}
        text = ""
        for title, lines in sections.items():
            lines = list(lines)
            assert len(lines) > 1, title
            text += f"== {title}\n" + "\n".join(lines) + "\n\n"
        return text


def main():
    path = SOURCE / "tests/project/interface.txt"
    now = interface()
    if "--write" in sys.argv:
        path.write_text(now, encoding="utf-8")
        return
    difference = list(difflib.unified_diff(path.read_text(encoding="utf-8").splitlines(),
                                           now.splitlines(), "interface.txt", "now", lineterm=""))
    if difference:
        print("\n".join(difference))
        sys.exit("What others rely on has changed. If docs/stability.md allows it: ./run interface "
                 "writes the list again")


main()

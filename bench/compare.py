#!/usr/bin/env python3
"""Renders the scenes of bench/scenes on Pumice and on every other driver found, by turns, and compares.

Each run is a process of its own: one scene, one driver. A round goes through all drivers, each round in another order;
what is printed are medians over the rounds. Beside the time by the clock stands the processor time (user and system, of
all threads of the process): on a machine that does other things too, only ratios of processor time can be trusted.
"""
import argparse
import json
import math
import os
import re
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LAVAPIPE = [Path("/usr/share/vulkan/icd.d"), Path("/usr/local/share/vulkan/icd.d")]
SWIFTSHADER = [Path("/usr/lib/chromium/vk_swiftshader_icd.json"), Path("/usr/share/vulkan/icd.d/vk_swiftshader_icd.json")]
RUN_TIMEOUT = 300  # seconds


def say(text):
    print(f"== {text}", file=sys.stderr, flush=True)


def find_drivers(build, extra):
    """name -> manifest; Pumice first."""
    machine = os.uname().machine
    drivers = {"Pumice": build / f"pumice_icd.{machine}.json"}
    if not drivers["Pumice"].exists():
        sys.exit(f"compare.py: no driver was built: {drivers['Pumice']} is missing")
    for folder in LAVAPIPE:
        for manifest in sorted(folder.glob("lvp_icd*.json")):
            drivers.setdefault("lavapipe", manifest)
    for manifest in SWIFTSHADER:
        if manifest.exists():
            drivers.setdefault("SwiftShader", manifest)
    for text in extra:
        name, _, manifest = text.partition("=")
        drivers[name] = Path(manifest)
    return drivers


def package_version(*packages):
    for package in packages:
        found = subprocess.run(["dpkg-query", "-W", "-f=${Version}", package], capture_output=True, text=True)
        if found.returncode == 0 and found.stdout:
            return f"{package} {found.stdout}"
    return ""


def machine():
    model = "unknown"
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            model = line.split(":", 1)[1].strip()
            break
    return {
        "processor": model,
        "processors": len(os.sched_getaffinity(0)),
        "date": time.strftime("%Y-%m-%d %H:%M", time.gmtime()) + " UTC",
        "load": os.getloadavg()[0],
        "peers": {
            "lavapipe": package_version("mesa-vulkan-drivers"),
            "SwiftShader": package_version("chromium-common", "chromium"),
        },
    }


class Runner:
    def __init__(self, build, drivers, seconds):
        self.program = build / "bench" / "scenes" / "pumice_scenes"
        if not self.program.exists():
            sys.exit(f"compare.py: {self.program} was not built")
        self.drivers = drivers
        self.seconds = seconds
        self.warned = set()

    def scenes(self):
        lines = subprocess.run([self.program, "--list"], capture_output=True, text=True, check=True).stdout.splitlines()
        return {words[0]: words[2] for words in (line.split(None, 2) for line in lines)}

    def limits(self):
        """Of all processors, and of one."""
        command = [self.program, "--limits", "--seconds", "0.5"]
        return {name: json.loads(subprocess.run([*command, *extra], capture_output=True, text=True, check=True).stdout)
                for name, extra in (("all", []), ("one", ["--threads", "1"]))}

    def once(self, driver, scene, arguments=(), environment=None, prefix=()):
        env = {**os.environ, "MESA_SHADER_CACHE_DISABLE": "true", **(environment or {})}
        manifest = str(self.drivers[driver])
        command = [*prefix, str(self.program), "--scene", scene, "--driver", manifest, "--seconds", str(self.seconds)]
        command += [*arguments, "--started", str(time.clock_gettime_ns(time.CLOCK_MONOTONIC))]
        try:
            done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=RUN_TIMEOUT)
        except subprocess.TimeoutExpired:
            return self.failed(driver, scene, f"not done after {RUN_TIMEOUT} s")
        try:
            result = json.loads(done.stdout.splitlines()[-1])
        except (IndexError, json.JSONDecodeError):
            lines = done.stderr.strip().splitlines()
            return self.failed(driver, scene, f"exit status {done.returncode}; {lines[-1] if lines else 'no output'}")
        if result["shaders_compiled"]:  # the first process ever: once more, with what it left in its cache
            return self.once(driver, scene, arguments, environment, prefix)
        return result

    def failed(self, driver, scene, why):
        if (driver, scene) not in self.warned:
            self.warned.add((driver, scene))
            say(f"{scene} on {driver}: {why}")
        return None

    def compare(self, scene, rounds, arguments=(), environment=None, prefix=()):
        """driver -> what was measured, or None."""
        names = list(self.drivers)
        runs = {name: [] for name in names}
        for turn in range(rounds):
            shift = turn % len(names)
            for name in names[shift:] + names[:shift]:
                if name in runs and (turn == 0 or runs[name]):
                    result = self.once(name, scene, arguments, environment, prefix)
                    if result:
                        runs[name].append(result)
        return {name: combine(results) for name, results in runs.items()}


def combine(results):
    if not results:
        return None
    whole = dict(results[0])
    for key, value in whole.items():
        if isinstance(value, float) or (isinstance(value, int) and key.endswith(("_ms", "_mib"))):
            pick = min if "_min_" in key else statistics.median
            whole[key] = pick(each[key] for each in results)
    whole["frames"] = sum(each["frames"] for each in results)
    whole["rounds"] = len(results)
    return whole


def ratio(measured, key):
    """How many times Pumice beats the best peer in `key`, and which peer that is."""
    ours = measured.get("Pumice")
    peers = {name: each[key] for name, each in measured.items() if name != "Pumice" and each}
    if not ours or not peers:
        return None, None
    best = min(peers, key=peers.get)
    return peers[best] / max(ours[key], 1e-9), best


def share(result, limits):
    """The parts of what the machine can do that the frame reaches: by the clock of what all processors can, and by processor
    time of what one can."""
    if not result or result["limit"] == "none" or not limits:
        return ""
    key, amount = {
        "fill": ("fill_bytes_per_second", "bytes"),
        "large_fill": ("large_fill_bytes_per_second", "bytes"),
        "copy": ("copy_bytes_per_second", "bytes"),
        "arithmetic": ("alu_flops_per_second", "flops"),
    }[result["limit"]]
    if not limits["all"][key]:
        return ""
    clock = result[amount] / (result["wall_min_ms"] * 1e-3) / limits["all"][key]
    processor = result[amount] / max(result["cpu_min_ms"] * 1e-3, 1e-7) / limits["one"][key]   # the clock of processor time may stand still
    return f"{clock:.0%} / {processor:.0%}"


def number(value):
    if value is None:
        return "-"
    if value >= 100:
        return f"{value:.0f}"
    if value >= 10:
        return f"{value:.1f}"
    return f"{value:.2f}" if value >= 0.1 else f"{value:.3f}"


def geometric_mean(values):
    values = [value for value in values if value]
    return math.exp(sum(map(math.log, values)) / len(values)) if values else None


def markdown_table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def comparison_table(results, names, limits):
    """One row a scene: milliseconds a frame by the clock / of processor time."""
    rows = []
    wall_ratios, cpu_ratios, best_ratios = [], [], []
    for scene, measured in results.items():
        row = [scene]
        for name in names:
            each = measured.get(name)
            row.append(f"{number(each['wall_ms'])} / {number(each['cpu_ms'])}" if each else "-")
        wall, _ = ratio(measured, "wall_ms")
        cpu, best = ratio(measured, "cpu_ms")
        quickest, _ = ratio(measured, "wall_min_ms")
        wall_ratios.append(wall), cpu_ratios.append(cpu), best_ratios.append(quickest)
        row += [number(wall), number(quickest), number(cpu), best or "-", share(measured.get("Pumice"), limits)]
        rows.append(row)
    mean = ["geometric mean"] + [""] * len(names)
    rows.append(mean + [number(geometric_mean(each)) for each in (wall_ratios, best_ratios, cpu_ratios)] + ["", ""])
    header = ["scene"] + [f"{name}, ms clock / processor" for name in names]
    return markdown_table(header + ["x clock", "x best frame", "x processor", "best peer", "of the limit"], rows)


def cold_table(results, names):
    rows = []
    for scene, measured in results.items():
        row = [scene]
        row += [f"{number(measured[name]['first_frame_ms'])} / {number(measured[name]['first_frame_cpu_ms'])}" if measured.get(name) else "-"
                for name in names]
        row += [number(measured[name]["peak_mib"]) if measured.get(name) else "-" for name in names]
        rows.append(row)
    header = ["scene"] + [f"{name}, first frame, ms clock / processor" for name in names] + [f"{name}, peak MiB" for name in names]
    return markdown_table(header, rows)


# ---- under a window system ---------------------------------------------------------------------------


class Xvfb:
    """A screen of its own, or None where there is no Xvfb."""

    def __enter__(self):
        self.server = None
        if not shutil.which("Xvfb"):
            return None
        read, write = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-noreset", "-screen", "0", "1600x1200x24"],
            pass_fds=[write], stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as numbers:
            display = numbers.readline().strip()
        return f":{display}" if display else None

    def __exit__(self, *_):
        if self.server:
            self.server.terminate()
            self.server.wait()


def vkcube(manifest, display, frames=300):
    """As many frames a second as it can, where the driver offers IMMEDIATE (0); else FIFO (2), which Xvfb does not hold back."""
    return vkcube_in_mode(manifest, display, frames, 0) or vkcube_in_mode(manifest, display, frames, 2)


def vkcube_in_mode(manifest, display, frames, mode):
    env = {**os.environ, "DISPLAY": display, "VK_ICD_FILENAMES": str(manifest), "VK_DRIVER_FILES": str(manifest)}
    command = ["vkcube", "--c", str(frames), "--width", "1280", "--height", "720", "--present_mode", str(mode),
               "--suppress_popups"]
    begin = time.monotonic()
    process = subprocess.Popen(["timeout", "-k", "5", "120", *command], env=env, stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = status
    if status != 0:
        return None
    seconds = time.monotonic() - begin
    return {"wall_ms": seconds / frames * 1e3, "wall_min_ms": seconds / frames * 1e3,
            "cpu_ms": (usage.ru_utime + usage.ru_stime) / frames * 1e3, "first_frame_ms": 0.0,
            "peak_mib": usage.ru_maxrss / 1024, "frames": frames, "limit": "none"}


# ---- single calls ------------------------------------------------------------------------------------


def calls(program, names, drivers, rounds):
    """Markdown of what single calls cost (bench_api): by the clock, and processor time of the thread that calls."""
    runs = {}
    for _ in range(rounds):
        for name in names:
            env = {**os.environ, "VK_ICD_FILENAMES": str(drivers[name]), "VK_DRIVER_FILES": str(drivers[name])}
            command = [str(program), "--benchmark_format=json", "--benchmark_min_time=0.1"]
            done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=RUN_TIMEOUT)
            if done.returncode:   # a driver may not have arrays of thousands of textures
                done = subprocess.run(command + ["--benchmark_filter=-drawsFromArray"], env=env, capture_output=True, text=True, timeout=RUN_TIMEOUT)
            if done.returncode:
                say(f"{name}: {program.name} fails: {done.stderr.strip()[-200:]}")
                continue
            for each in json.loads(done.stdout)["benchmarks"]:
                to_us = {"ns": 1e-3, "us": 1, "ms": 1e3}[each["time_unit"]]
                call = each["name"].split("/")[0] + (f", {each['label']}" if each.get("label") else "")
                runs.setdefault(call, {}).setdefault(name, []).append((each["real_time"] * to_us, each["cpu_time"] * to_us))
    rows = []
    for call, by_driver in runs.items():
        medians = {name: [statistics.median(column) for column in zip(*each)] for name, each in by_driver.items()}
        row = [call] + [f"{number(medians[name][0])} / {number(medians[name][1])}" if name in medians else "-" for name in names]
        for column in (0, 1):
            peers = [medians[name][column] for name in medians if name != "Pumice"]
            row.append(number(min(peers) / max(medians["Pumice"][column], 1e-9)) if peers and "Pumice" in medians else "-")
        rows.append(row)
    header = ["call"] + [f"{name}, us clock / processor" for name in names] + ["x clock", "x processor"]
    return "### Calls\n\n" + markdown_table(header, rows) + "\n"


# ---- how it grows ------------------------------------------------------------------------------------


def scaling(runner, names, largest):
    """Markdown of how time and memory grow with triangles, pixels and processors."""
    text = []

    def table(title, first, cases):
        rows = []
        for label, scene, arguments, prefix in cases:
            measured = runner.compare(scene, 1, arguments, None, prefix)
            row = [label]
            for name in names:
                each = measured.get(name)
                row.append(f"{number(each['wall_ms'])} / {number(each['cpu_ms'])} / {number(each['peak_mib'])}" if each else "-")
            rows.append(row)
            say(f"{title}: {' | '.join(row)}")
        header = [first] + [f"{name}, ms clock / ms processor / MiB" for name in names]
        text.append(f"### {title}\n\n{markdown_table(header, rows)}\n")

    table("Triangles of two pixels", "triangles",
          [(f"1e{power}", "triangles_million", ["--amount", str(10 ** power), "--frames", "1", "--warm", "2" if power < 7 else "0"], ())
           for power in range(4, 9) if 10 ** power <= largest])
    table("Pixels of one triangle", "side",
          [(str(side), "full_screen_triangle", ["--size", f"{side}x{side}"], ()) for side in (256, 1024, 4096, 16384)])
    if shutil.which("taskset"):
        cpus = sorted(os.sched_getaffinity(0))
        counts = [count for count in (1, 2, 4, 8, 16, 32, 64) if count <= len(cpus)]
        for scene in ("triangles_million", "alu", "layers_blended"):
            table(f"Processors: {scene}", "processors",
                  [(str(count), scene, [], ("taskset", "-c", ",".join(map(str, cpus[:count])))) for count in counts])
    return "\n".join(text)


def ablations(runner, ideas, scenes, rounds):
    """Markdown of what each idea saves: processor time of Pumice without it, by turns with the whole."""
    rows = []
    for scene in scenes:
        if scene == "present":
            continue
        runs = {idea: [] for idea in ["", *ideas]}
        for _ in range(rounds):
            for idea, results in runs.items():
                result = runner.once("Pumice", scene, (), {"PUMICE_DISABLE": idea} if idea else None)
                if result:
                    results.append(result["cpu_ms"])
        if not all(runs.values()):
            continue
        whole = statistics.median(runs[""])
        without = [statistics.median(runs[idea]) / max(whole, 1e-9) for idea in ideas]
        say(f"{scene}: {number(whole)}; without " + ", ".join(f"{idea} x {number(r)}" for idea, r in zip(ideas, without)))
        if any(r > 1.1 or r < 0.9 for r in without):
            rows.append([scene, number(whole)] + [number(r) for r in without])
    header = ["scene", "ms processor"] + [f"without {idea}" for idea in ideas]
    return ("### What each idea saves\n\nProcessor time without it (`PUMICE_DISABLE`), as a multiple of the whole's; scenes where any "
            "changes by more than a tenth.\n\n" + markdown_table(header, rows) + "\n")


def main():
    parser = argparse.ArgumentParser(prog="./dev bench", description=__doc__.split("\n\n")[0],
                                     epilog=__doc__.split("\n\n", 1)[1], formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release", help="the build directory")
    parser.add_argument("--scenes", default=".", help="regular expression: only scenes whose name it matches")
    parser.add_argument("--list", action="store_true", help="the scenes, and nothing else")
    parser.add_argument("--rounds", type=int, default=5, help="runs of each scene on each driver (default: 5)")
    parser.add_argument("--seconds", type=float, default=0.6, help="of measuring in each run (default: 0.6; at least 3 frames)")
    parser.add_argument("--quick", action="store_true", help="one round of 0.2 seconds")
    parser.add_argument("--peer", action="append", default=[], metavar="NAME=MANIFEST", help="another driver to compare with")
    parser.add_argument("--without", action="append", default=[], metavar="NAME", help="leave this peer out")
    parser.add_argument("--scaling", action="store_true", help="also how time grows with triangles, pixels, processors")
    parser.add_argument("--largest", type=int, default=10 ** 8, help="most triangles of --scaling")
    parser.add_argument("--ablations", metavar="IDEA,...", default="", help="also Pumice without each of these (PUMICE_DISABLE)")
    parser.add_argument("--only-ablations", action="store_true", help="those, and nothing else")
    parser.add_argument("--only-scaling", action="store_true", help="that, and nothing else")
    parser.add_argument("--into", type=Path, help="also put it between the marks <!-- measured --> and <!-- end --> of this file")
    parser.add_argument("--out", type=Path, help="where bench.json and bench.md go (default: bench/ in the build directory)")
    given = parser.parse_args()
    if given.quick:
        given.rounds, given.seconds = 1, 0.2

    drivers = find_drivers(given.build, given.peer)
    for name in given.without:
        drivers.pop(name, None)
    runner = Runner(given.build, drivers, given.seconds)
    scenes = {name: what for name, what in runner.scenes().items() if re.search(given.scenes, name)}
    if given.list:
        for name, what in runner.scenes().items():
            print(f"{name:24} {what}")
        return 0
    names = list(drivers)
    about = machine()
    say(f"{about['processor']}, {about['processors']} processors, load {about['load']:.1f}; " + ", ".join(names))
    if len(names) == 1:
        say("no other driver was found: nothing to compare with")

    results = {}
    text = ""
    limits = None
    if not given.only_scaling and not given.only_ablations:
        limits = runner.limits()
        with Xvfb() as display:
            if display:
                os.environ["DISPLAY"] = display
            for scene in scenes:
                if scene == "present" and not display:
                    say("no Xvfb: nothing is presented")
                    continue
                results[scene] = runner.compare(scene, given.rounds)
                report(scene, results[scene], names)
            if display and shutil.which("vkcube") and re.search(given.scenes, "vkcube"):
                runs = {name: [] for name in names}
                for _ in range(given.rounds):
                    for name in names:
                        once = vkcube(drivers[name], display)
                        if once:
                            runs[name].append(once)
                results["vkcube"] = {name: combine(each) for name, each in runs.items()}
                report("vkcube", results["vkcube"], names)
        cold = {scene: measured for scene, measured in results.items() if scene != "vkcube"}
        text += (f"{about['processor']}, {about['processors']} processors, {about['date']}, load {about['load']:.1f}. "
                 + "; ".join(f"{name}: {version}" for name, version in about["peers"].items() if version) + ".\n\n"
                 + f"Milliseconds a frame, medians of {given.rounds} alternating rounds. `x`: how many times Pumice is faster than the "
                   "best peer of that scene.\n\n"
                 + comparison_table(results, names, limits) + "\n\n" + cold_table(cold, names) + "\n\n"
                 + "Limits measured just before, all processors / one: "
                 + ", ".join(f"{key.replace('_per_second', '').replace('_', ' ')} {value / 1e9:.1f} / {limits['one'][key] / 1e9:.1f} G/s"
                             for key, value in limits["all"].items() if key != "threads") + ".\n")
        program = given.build / "bench" / "bench_api"
        if re.search(given.scenes, "calls") and program.exists():
            text += "\n" + calls(program, names, drivers, given.rounds)
    if (given.scaling or given.only_scaling) and not given.only_ablations:
        text += "\n" + scaling(runner, names, given.largest)
    if given.ablations:
        text += "\n" + ablations(runner, given.ablations.split(","), scenes, given.rounds)

    print(text)
    folder = given.out or given.build / "bench"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "bench.md").write_text(text)
    (folder / "bench.json").write_text(json.dumps({"machine": about, "limits": limits, "scenes": results}, indent=1) + "\n")
    if given.into:
        head, _, rest = given.into.read_text().partition("<!-- measured -->")
        _, _, tail = rest.partition("<!-- end -->")
        given.into.write_text(f"{head}<!-- measured -->\n\n{text}\n<!-- end -->{tail}")
    say(f"written: {folder / 'bench.md'}, {folder / 'bench.json'}")
    return 0


def report(scene, measured, names):
    wall, _ = ratio(measured, "wall_ms")
    cpu, best = ratio(measured, "cpu_ms")
    each = ", ".join(f"{name} {number(measured[name]['wall_ms'])}/{number(measured[name]['cpu_ms'])}" if measured.get(name)
                     else f"{name} -" for name in names)
    say(f"{scene}: {each}; x {number(wall)} clock, x {number(cpu)} processor ({best})")


if __name__ == "__main__":
    sys.exit(main())

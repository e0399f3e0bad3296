"""An installed tree works wherever it is moved, and its manifest tells the truth about the API version.

usage: check_installed.py <cmake> <build folder>
"""
import glob
import json
import os
import re
import subprocess
import sys
import tempfile

cmake, build = sys.argv[1:]


def fail(message):
    print(message)
    sys.exit(1)


with tempfile.TemporaryDirectory() as folder:
    first, moved = os.path.join(folder, "first"), os.path.join(folder, "moved", "deeper")
    subprocess.run([cmake, "--install", build, "--prefix", first], check=True, stdout=subprocess.DEVNULL)
    os.makedirs(os.path.dirname(moved))
    os.rename(first, moved)

    manifests = glob.glob(os.path.join(moved, "share/vulkan/icd.d/*.json"))
    if len(manifests) != 1 or not os.path.basename(manifests[0]).startswith("pumice_icd."):
        fail(f"expected one manifest, found {manifests}")
    with open(manifests[0]) as file:
        icd = json.load(file)["ICD"]
    path = icd["library_path"]
    if os.path.isabs(path):
        fail(f"library_path {path} is not relative")
    library = os.path.normpath(os.path.join(os.path.dirname(manifests[0]), path))
    if not os.path.isfile(library):
        fail(f"library_path {path} leads to {library}, which does not exist")

    environment = dict(os.environ, VK_ICD_FILENAMES=manifests[0], VK_DRIVER_FILES=manifests[0])
    run = subprocess.run(["vulkaninfo", "--summary"], env=environment, text=True, timeout=50,
                         stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if run.returncode != 0:
        fail(f"vulkaninfo --summary: exit status {run.returncode}\n{run.stdout}")
    names = re.findall(r"deviceName\s*=\s*(.*)", run.stdout)
    versions = re.findall(r"apiVersion\s*=\s*([0-9.]+)", run.stdout)
    if len(names) != 1 or "Pumice" not in names[0]:
        fail(f"expected one device, Pumice; found {names}\n{run.stdout}")
    if versions != [icd["api_version"]]:
        fail(f"the manifest says api_version {icd['api_version']}, the device {versions}")

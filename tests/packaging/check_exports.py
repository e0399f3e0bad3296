"""The driver exports the loader's three entry points and nothing else.

usage: check_exports.py <nm> <library>
"""
import subprocess
import sys

EXPECTED = {
    "vk_icdNegotiateLoaderICDInterfaceVersion",
    "vk_icdGetInstanceProcAddr",
    "vk_icdGetPhysicalDeviceProcAddr",
}

nm, library = sys.argv[1:]
listing = subprocess.run([nm, "-D", "--defined-only", library], check=True, text=True, stdout=subprocess.PIPE).stdout
exported = {line.split()[-1].split("@")[0] for line in listing.splitlines() if line.split()[-2] != "A"}
for name in sorted(exported - EXPECTED):
    print("exported but should not be:", name)
for name in sorted(EXPECTED - exported):
    print("not exported:", name)
sys.exit(exported != EXPECTED)

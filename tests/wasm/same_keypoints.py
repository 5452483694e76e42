"""usage: same_keypoints.py NATIVE NODE SCRIPT: both print the same keypoints."""
import subprocess
import sys


def keypoints_of(command):
    rows = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split("\n")
    return [row.split() for row in rows if row]


native = keypoints_of(sys.argv[1:2])
browser = keypoints_of(sys.argv[2:])
print(f"{len(native)} keypoints natively, {len(browser)} in WebAssembly")
assert len(native) >= 12
assert [row[:3] for row in native] == [row[:3] for row in browser], (native, browser)
for ours, theirs in zip(native, browser):
    assert abs(float(ours[3]) - float(theirs[3])) <= 1e-9 * abs(float(ours[3])), (ours, theirs)

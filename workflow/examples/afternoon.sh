#!/usr/bin/env bash
# From a robot that the project does not know to a corrected one, as README has it: the robot is a KUKA KR 16-2 from a public
# URDF, and a physical robot in simulation with hidden defects stands in for it. Usage: afternoon.sh [FOLDER]
set -euo pipefail
cd "$(dirname "$0")/../.."
export PATH="$PWD/.venv/bin:$PATH"
cell="${1:-campaigns/kr16}"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
# The URDF is in a wheel of the package registry.
python -m pip download -q --no-deps rtb-data==2.0.0 -d "$work"
python -m zipfile -e "$work"/rtb_data-*.whl "$work"
cp "$work/rtbdata/xacro/kuka_description/kuka_kr16/urdf/kr16_2.urdf" "$work/arm.urdf"

elastocal import urdf "$work/arm.urdf" --base base_link --tip tool0 --point link_3 --output "$work/robot.yaml"
elastocal plan "$work/robot.yaml" --folder "$cell" --poses 25 --force 200 --pull --base-known --measured pose \
    --target tool0=0,0,0 --target link_3=0,0,0 --tracker 3,1,1.5
python workflow/examples/rehearse.py measure "$cell"
elastocal check "$cell"
elastocal diagnose "$cell"
python workflow/examples/rehearse.py path "$cell" "$work/path.csv"
elastocal export "$cell" --urdf "$work/arm.urdf" --output "$work/calibrated"
elastocal certificate "$cell" --tolerance 0.5mm
elastocal correct "$cell" "$work/path.csv" --output "$work/targets.csv" --format krl
python workflow/examples/rehearse.py remeasure "$cell" "$work/targets.csv" "$work/measured.csv"
elastocal verify "$cell" "$work/measured.csv" --tolerance 0.5mm
python workflow/examples/rehearse.py move "$cell" "$work/path.csv" "$work/targets.csv" --reveal

#!/bin/sh
# Starts the virtual rig and its monitor in the present folder. Both run in one container: a pty is visible in no other.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
cp "$here/site.toml" site.toml
python -c 'from updater import t_structure_toml; print(t_structure_toml(), end="")' > t_structure.toml
rm -rf ports ports.json
modalwatch rig "$here/scenario.toml" --ports ports.json --report rig.json --force &
until [ -s ports.json ]; do
    kill -0 $! # ends this script if the rig has ended
    sleep 0.2
done
mkdir ports
python -c 'import json, os
for name, port in json.load(open("ports.json"))["ports"].items():
    os.symlink(port, f"ports/{name}")'
exec modalwatch run site.toml

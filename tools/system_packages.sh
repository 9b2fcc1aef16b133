#!/bin/sh
# Checks for what pip cannot install: Python's venv module and the libraries that open3d (extra `sim`) links to.
# As root on Debian or Ubuntu it installs what is missing, else it prints the line that does. Usage: system_packages.sh [PYTHON]
set -eu

python=${1:-}
if [ -z "$python" ]; then
    echo "Python 3.11 to 3.13 was wanted, none was found (Debian: apt-get install python3 python3-venv)" >&2
    exit 1
fi
if ! "$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))'; then
    echo "Python 3.11 to 3.13 was wanted, $python is $("$python" -V); name another with make PYTHON=..." >&2
    exit 1
fi

missing=
has() { { ldconfig -p 2>/dev/null || /sbin/ldconfig -p; } | grep -qF "$1"; }
want() { has "$1" || missing="$missing $2"; }
if [ "$(uname -s)" = Linux ]; then
    want libEGL.so.1 libegl1
    want libGL.so.1 libgl1
    want libX11.so.6 libx11-6
    want libusb-1.0.so.0 libusb-1.0-0
fi
"$python" -c 'import ensurepip, venv' 2>/dev/null || missing="$missing python3-venv"

[ -n "$missing" ] || exit 0
command="apt-get install -y --no-install-recommends$missing"
if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null; then
    echo "missing system packages:$missing; installing them"
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive $command -qq
else
    echo "missing system packages:$missing" >&2
    echo "install them, then run make again (Debian, Ubuntu): sudo $command" >&2
    exit 1
fi

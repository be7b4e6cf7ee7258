#!/bin/sh
# Make sure that one OpenCL device works; with 'all' instead of 'device' also that VkFFT can be
# built for it, and that reports can be opened in a browser.
set -eu
BIN=$1
WANTED=$2
packages=""
"$BIN/tactograph" devices --require >/dev/null 2>&1 || packages="$packages pocl-opencl-icd"
if [ "$WANTED" = all ]; then
    [ -e /usr/include/CL/cl.h ] || packages="$packages opencl-c-headers"
    ls /usr/lib/*/libOpenCL.so /usr/lib*/libOpenCL.so >/dev/null 2>&1 || packages="$packages ocl-icd-opencl-dev"
    command -v chromium >/dev/null 2>&1 || command -v chromium-browser >/dev/null 2>&1 || packages="$packages chromium"
    command -v c++ >/dev/null 2>&1 || packages="$packages g++"
fi
[ -n "$packages" ] || exit 0
if [ "$(id -u)" = 0 ]; then sudo=""; else sudo="sudo -n"; fi
if command -v apt-get >/dev/null 2>&1 && { [ -z "$sudo" ] || $sudo true 2>/dev/null; }; then
    $sudo apt-get update -qq
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq --no-install-recommends $packages >/dev/null
else
    echo "the tests need these packages, and may not install them:$packages" >&2
    exit 1
fi

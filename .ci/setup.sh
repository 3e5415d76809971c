# Sourced by the scripts that build something, such as tests/run and examples/quickstart (bash): installs the packages that are
# needed, configures and builds, and makes a place to draw pictures.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# What the library and its program are built with, on Debian.
library_packages=(g++ cmake ninja-build pkg-config libembree-dev libmuparser-dev nlohmann-json3-dev libcli11-dev)
# And the drivers that are modules, and the bridge.
module_packages=(libboost-dev libusb-1.0-0-dev cyclonedds-dev cyclonedds-tools)

# need_packages NAME...: installs the missing ones of these Debian packages, or says how.
need_packages() {
  if ! command -v apt-get > /dev/null || ! command -v dpkg-query > /dev/null; then
    need_tools "$@"
    return
  fi
  local missing=() package
  for package in "$@"; do
    dpkg-query -W -f '${Status}' "$package" 2> /dev/null | grep -q '^install ok installed$' || missing+=("$package")
  done
  [ ${#missing[@]} -gt 0 ] || return 0

  local as_root=()
  if [ "$(id -u)" != 0 ]; then
    as_root=(sudo -n)
    if ! sudo -n true 2> /dev/null; then
      echo "Some packages are missing. Please install them and try again:" >&2
      echo "  sudo apt-get install ${missing[*]}" >&2
      exit 1
    fi
  fi
  echo "Installing ${missing[*]} ..."
  local get=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=400 -qq)
  local log
  log=$(mktemp)
  if ! "${get[@]}" --no-install-recommends -y install "${missing[@]}" > "$log" 2>&1 < /dev/null; then
    # The list of packages may be old or missing: fetch it and try again.
    if ! { "${get[@]}" update && "${get[@]}" --no-install-recommends -y install "${missing[@]}"; } \
        >> "$log" 2>&1 < /dev/null; then
      cat "$log" >&2
      rm -f "$log"
      echo "This failed: apt-get install ${missing[*]}" >&2
      exit 1
    fi
  fi
  rm -f "$log"
}

# package_sources: from where this machine has the packages of its Debian or Ubuntu, but for those of others; lines as of sources.list.
package_sources() {
  apt-get indextargets --format 'deb $(REPO_URI) $(RELEASE) $(COMPONENT)' 'Identifier: Packages' \
    "Origin: $(. /etc/os-release && echo "${ID^}")" | sort -u
}

# need_tools NAME...: for other systems than Debian. Ends with a message when a tool is missing; CMake reports a missing
# library. NAME...: the Debian packages, for the message.
need_tools() {
  local tool absent=()
  for tool in c++ cmake ninja pkg-config; do
    command -v "$tool" > /dev/null || absent+=("$tool")
  done
  if [ ${#absent[@]} -gt 0 ]; then
    echo "Missing: ${absent[*]}. On Debian these packages have all that is needed; elsewhere look for similar ones:" >&2
    echo "  $*" >&2
    exit 1
  fi
}

# configure FOLDER [CMAKE OPTION...]: quiet unless it fails. A folder of another build tool is configured from scratch.
configure() {
  local folder=$1 launcher=()
  shift
  if [ -e "$folder/CMakeCache.txt" ] && ! grep -q '^CMAKE_GENERATOR:INTERNAL=Ninja$' "$folder/CMakeCache.txt"; then
    rm -rf "$folder/CMakeCache.txt" "$folder/CMakeFiles"
  fi
  if command -v ccache > /dev/null && [ -z "${CCACHE_DISABLE-}" ]; then
    launcher=(-DCMAKE_C_COMPILER_LAUNCHER=ccache -DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
  fi
  mkdir -p "$folder"
  if ! cmake -S "$root" -B "$folder" -G Ninja "${launcher[@]}" "$@" > "$folder/configure.log" 2>&1; then
    cat "$folder/configure.log"
    return 1
  fi
}

# build FOLDER [TARGET...]: shows one line of progress on a terminal; elsewhere prints only errors. CMAKE_BUILD_PARALLEL_LEVEL: how
# many compilers run at a time.
build() {
  local folder=$1
  shift
  [ -z "${CMAKE_BUILD_PARALLEL_LEVEL-}" ] || set -- -j "$CMAKE_BUILD_PARALLEL_LEVEL" "$@"
  echo "building in ${folder#"$PWD/"}"
  if [ -t 1 ]; then
    ninja -C "$folder" "$@"
  else
    ninja -C "$folder" --quiet "$@"
  fi
}

# tell SIGNAL PROCESS...: sends the signal to programs that this shell has begun, but not to scripts of bash. A child that is still a
# copy of this shell would lose the signal, so this first waits until it has become its program: 10 s at most for each.
tell() {
  local process i
  for process in "${@:2}"; do
    for ((i = 0; i < 1000; ++i)); do
      [ "/proc/$process/exe" -ef "/proc/$$/exe" ] || break
      sleep 0.01 || true
    done
    kill "-$1" "$process" 2> /dev/null || true
  done
}

# has_package_index PACKAGE: whether pip can fetch this package of Python, in an environment of its own.
has_package_index() {
  need_packages python3-venv
  local folder status
  folder=$(mktemp -d)
  "${PYTHON:-python3}" -m venv "$folder/environment" &&
    "$folder/environment/bin/pip" download -q --no-deps --dest "$folder" "$1"
  status=$?
  rm -rf "$folder"
  return $status
}

# make_venv FOLDER PACKAGES: an environment of Python with these packages (a list in one word) where there is none yet. Ends with 77
# where there is no package index.
make_venv() {
  local python=${PYTHON:-python3} made_for
  made_for="$("$python" --version) $2"
  [ "$(cat "$1/made_for" 2> /dev/null)" != "$made_for" ] || return 0
  # shellcheck disable=SC2086  # a list
  if ! { rm -rf "$1" && "$python" -m venv "$1" && "$1/bin/pip" install -q $2; }; then
    if has_package_index pip > /dev/null 2>&1; then
      echo "FAILED: $2 cannot be installed"
      exit 1
    fi
    echo "Python's venv and a package index are needed for: $2"
    exit 77
  fi
  echo "$made_for" > "$1/made_for"
}

# Makes an environment of Python with matplotlib, in which pictures are drawn. The last line that it prints says why there
# is none.
environment=$root/build/picture
make_environment() {
  [ ! -e "$environment/is_complete" ] || return 0
  command -v python3 > /dev/null || { echo "python3 is missing (Debian: python3)"; return 1; }
  python3 -c 'import venv, ensurepip' || { echo "Python has no venv (Debian: python3-venv)"; return 1; }
  if ! { rm -rf "$environment" && python3 -m venv "$environment" &&
    "$environment/bin/pip" install -q --retries 1 --timeout 20 matplotlib &&
    "$environment/bin/python" -c 'import matplotlib.pyplot'; }; then
    echo "pip cannot install matplotlib"
    return 1
  fi
  touch "$environment/is_complete"
}

# need_driver URI: ends with a message where no driver can open such a device.
need_driver() {
  local name=${1%%:*}
  [[ "$1" == *:* ]] && [ -n "$name" ] && [ -d "$root/device/$name" ] && return
  [[ "$1" == *:* ]] && [ -n "$(find -L "$root/build" -path "*/drivers-1/$name.so" 2> /dev/null)" ] && return
  echo "the device '$1': it must begin with the name of a driver and a colon, such as sim: (device/README.md)" >&2
  exit 2
}

# prepare_python FOLDER PACKAGE...: makes an environment of Python with forceserver, what it takes to build that, and these packages.
# PYTHON: another interpreter. FORCESERVER_WHEEL: a wheel of the Python package, used instead of building it.
prepare_python() {
  local folder=$1 python=${PYTHON:-python3} headers made_for
  shift
  need_packages "${library_packages[@]}" python3-venv python3-dev
  headers=$("$python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
  [ -e "$headers/Python.h" ] || { echo "$headers has no Python.h (Debian: python3-dev)" >&2; exit 1; }
  made_for="$("$python" --version) $*"
  if [ "$(cat "$folder/made_for" 2> /dev/null)" != "$made_for" ]; then
    rm -rf "$folder"
    "$python" -m venv "$folder"
    "$folder/bin/pip" install -q "scikit-build-core>=1.0" "pybind11>=3" "$@"
    echo "$made_for" > "$folder/made_for"
  fi
  if command -v ccache > /dev/null && [ -z "${CCACHE_DISABLE-}" ]; then
    export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
  fi
  install_python=("$folder/bin/pip" install -q --no-build-isolation --no-deps --force-reinstall)
  if [ -n "${FORCESERVER_WHEEL-}" ]; then
    "${install_python[@]}" "$FORCESERVER_WHEEL"
  else
    "${install_python[@]}" --config-settings=build-dir="$root/build/wheel" "$root/bindings/python"
  fi
}

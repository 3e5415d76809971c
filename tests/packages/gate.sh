# gate.sh: what `run` does as root in a fresh Debian that it has made, with the packages in /gate. It ends at the first thing that
# is wrong.
set -Eeuo pipefail
cd /gate
fail() { echo "FAILED: $*"; exit 1; }
trap 'echo "FAILED: line $LINENO of gate.sh: $BASH_COMMAND"' ERR
apt() {
  apt-get -qq -o Binary::apt-get::APT::Keep-Downloaded-Packages=true "$@" > apt.log 2>&1 || { cat apt.log; fail "apt-get $*"; }
}
# files: all names in this system, but for those of apt's own lists, caches and logs.
files() {
  find / -xdev \( -path /proc -o -path /sys -o -path /dev -o -path /tmp -o -path /gate -o -path /var/cache -o -path /var/log \
    -o -path /var/lib/apt \) -prune -o -print | sort
}
# installed: the size of all packages that are installed, in kB.
installed() { dpkg-query -W -f '${Installed-Size}\n' | awk '{ sum += $1 } END { print sum }'; }
# library_of PROGRAM: the library forceserver that the loader takes for it.
library_of() { ldd "$1" | sed -nE 's/.*libforceserver\.so\.[0-9]+ => (\S+) .*/\1/p' | xargs realpath; }
now() { date +%s.%N; }
since() { awk -v a="$1" -v b="$(now)" 'BEGIN { printf "%.1f", b - a }'; }
of_system=/usr/lib/$(dpkg --print-architecture | sed 's/amd64/x86_64/; s/arm64/aarch64/')-linux-gnu

# The program and what it needs, nothing else.
files > before
bare=$(now) begin=$bare
apt update
echo "package lists: $(since "$begin") s"
begin=$(now)
apt -y --download-only install ./libforceserver1_*.deb ./forceserver_*.deb
downloaded=$(since "$begin")
begin=$(now) had=$(installed)
apt -y install ./libforceserver1_*.deb ./forceserver_*.deb
echo "the program: $(grep -c '^Setting up' apt.log) packages, $((($(installed) - had) / 1000)) MB installed," \
  "downloaded in $downloaded s, installed in $(since "$begin") s"
forceserver run room.json --device 'sim:?hold=0.03,0,0' --duration 1 --record ticks.csv > /gate/said
awk -F, 'NR > 1 && $13 < -1 { felt = 1 } END { exit !felt }' ticks.csv || { cat said; fail "no force is felt"; }
echo "from a bare Debian to a second of felt force: $(since "$bare") s"
[[ $(forceserver --version) = "forceserver "[0-9]* ]]
[ "$(echo 0 0 -0.06 | forceserver evaluate room.json | tail -n 1 | cut -d, -f 6 | cut -c 1-5)" = 9.763 ]
forceserver devices --why > devices
for driver in dhd falcon fidel haply openhaptics; do grep -q "^driver $driver: " devices || fail "no driver $driver"; done
grep -q "^driver falcon: $of_system/forceserver/drivers-1/falcon.so" devices
grep -q 0403 /usr/lib/udev/rules.d/60-forceserver.rules
if command -v cc c++ cmake python3; then fail "there are more tools than a bare Debian has"; fi
echo "the program runs, and has its drivers"

# The bridge.
apt -y install ./forceserver-dds_*.deb
forceserver-bridge --help > /dev/null
/usr/share/forceserver/make-keys room here > /dev/null
[ -s room/here/permissions.p7s ]

# Nothing is left when they are removed.
apt -y purge libforceserver1 forceserver forceserver-dds
apt -y autoremove --purge
files > after
diff before after || fail "this is left behind"
echo "removed without a rest"

# A program in C, by CMake and by pkg-config.
begin=$(now) had=$(installed)
apt -y install ./libforceserver1_*.deb ./libforceserver-dev_*.deb
echo "the library and its headers: $((($(installed) - had) / 1000)) MB installed, in $(since "$begin") s"
apt -y install --no-install-recommends gcc libc6-dev cmake make pkg-config
by_cmake() {
  rm -rf build
  cmake -B build > cmake.log && cmake --build build > cmake.log || { cat cmake.log; fail "CMake"; }
}
by_pkg_config() { cc hello.c $(pkg-config --cflags --libs forceserver) -o hello; }
by_cmake
by_pkg_config
for program in build/hello ./hello; do
  said=$($program)
  [[ $said = "the hand is at "*" mm and feels -2."*" N" ]] || fail "$program says: $said"
  [ "$(library_of $program)" = $of_system/libforceserver.so.1 ]
done
echo "hello by CMake and by pkg-config: $said ($SECONDS s so far)"

# A build in /usr/local beside the packages: CMake, pkg-config and the loader take that one, and so does a program that was built
# with the packages. The program of the packages keeps to the library of the packages.
apt -y install ./forceserver_*.deb
for package in ./*.deb; do dpkg-deb -x "$package" other; done  # all files find each other, wherever they are
cp -r other/usr/. /usr/local
ldconfig
by_cmake
of_local=/usr/local/${of_system#/usr/}
grep -q "^forceserver_DIR:PATH=$of_local/" build/CMakeCache.txt
[ "$(library_of build/hello)" = $of_local/libforceserver.so.1 ]
[ "$(realpath "$(pkg-config --variable=libdir forceserver)")" = $of_local ]
[ "$(ldconfig -p | sed -nE 's/.*libforceserver\.so\.1 .* => //p' | head -n 1)" = $of_local/libforceserver.so.1 ]
[ "$(library_of ./hello)" = $of_local/libforceserver.so.1 ]
[ "$(library_of /usr/bin/forceserver)" = $of_system/libforceserver.so.1 ]
[ "$(library_of /usr/local/bin/forceserver)" = $of_local/libforceserver.so.1 ]
./hello > /dev/null
/usr/bin/forceserver devices --why | grep -q "^driver falcon: $of_system/"
/usr/local/bin/forceserver devices --why | grep -q "^driver falcon: $of_local/"
(cd other/usr && find . -depth -mindepth 1) | sed 's,^\.,/usr/local,' > of_other
xargs rm -d < of_other 2> /dev/null || true  # folders that hold other things stay
ldconfig
[ "$(library_of ./hello)" = $of_system/libforceserver.so.1 ]
echo "a build in /usr/local: CMake, pkg-config and the loader take it; the packaged program keeps to its own library"

# A wheel beside the packages has all its own, and its scene joins the server of the packages.
wheel=$(ls ./*.whl 2> /dev/null || true)
if [ -n "$wheel" ]; then
  apt -y install --no-install-recommends python3-numpy
  [[ $wheel = *-cp$(python3 -c 'import sys; print("%d%d" % sys.version_info[:2])')-* ]] || fail "$wheel is for another Python"
  python3 -m zipfile -e "$wheel" wheel
  forceserver run room.json --listen lab --duration 60 > /dev/null &
  server=$!
  PYTHONPATH=wheel python3 - << 'PYTHON'
import forceserver as fs
scene = fs.connect("shm:lab?timeout=10", "wheel")
scene["spring"] = fs.Point(front=fs.LinearIncreasing(200, limit=5))
scene.sync(1)
files = {line.split()[-1] for line in open("/proc/self/maps") if "libforceserver" in line}
assert all("/gate/wheel/" in file for file in files) and files, files
print("a wheel: its own library is loaded, and its scene is at the server of the package:", list(scene))
PYTHON
  kill -INT $server
  wait $server || fail "the server ends with $?"
fi

# Only the packages of others stay, such as the compiler.
apt -y purge '~n^libforceserver' '~n^forceserver'
echo "all removed, $SECONDS s"
files > last
! grep forceserver last || fail "this is left"

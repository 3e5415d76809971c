#!/usr/bin/env bash
# picture.sh SOURCE_FOLDER: where examples/quickstart cannot have its picture it says why in one sentence, and ends as the
# flight did. It runs in a folder of its own with tools and a flight that only seem to be there.
set -uo pipefail
source_folder=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
failures=0

mkdir -p "$folder/root/examples" "$folder/root/.ci" "$folder/root/build/release/examples" "$folder/tools"
cp "$source_folder/examples/quickstart" "$folder/root/examples"
cp "$source_folder/.ci/setup.sh" "$folder/root/.ci"
for tool in bash cat dirname grep mkdir mktemp renice rm sed sleep tail touch uname; do
  ln -s "$(command -v $tool)" "$folder/tools/$tool"
done

# stand_in NAME LINE: a tool, or the flight.
stand_in() {
  printf '#!/usr/bin/env bash\n%s\n' "$2" > "$1"
  chmod +x "$1"
}
for tool in cmake ninja c++ pkg-config; do stand_in "$folder/tools/$tool" ''; done
stand_in "$folder/tools/dpkg-query" 'echo install ok installed'

# expect STATUS LAST_LINE: of a flight that ends with that status.
expect() {
  local said status
  stand_in "$folder/root/build/release/examples/quickstart" "sleep 0.5; echo the table; exit $1"
  said=$(PATH=$folder/tools "$folder/root/examples/quickstart" --seconds 2 2>&1)
  status=$?
  if [ $status != "$1" ] || [ "$(tail -n 1 <<< "$said")" != "$2" ] || ! grep -q 'the table' <<< "$said"; then
    echo "FAILED: status $status, not $1, or the last line is not '$2':"
    echo "$said"
    failures=$((failures + 1))
  fi
}

expect 0 "there is no picture: python3 is missing (Debian: python3)"
stand_in "$folder/tools/python3" 'exit 1'
expect 0 "there is no picture: Python has no venv (Debian: python3-venv)"
stand_in "$folder/tools/python3" '[ "$2" != venv ]'
expect 0 "there is no picture: pip cannot install matplotlib"
expect 1 "the table"

# An environment that is there, with a Python that cannot draw, then with one that can.
mkdir -p "$folder/root/build/picture/bin"
touch "$folder/root/build/picture/is_complete"
stand_in "$folder/root/build/picture/bin/python" 'echo no colours left; exit 1'
expect 0 "there is no picture: no colours left"
stand_in "$folder/root/build/picture/bin/python" ''
expect 0 "a picture of it: $folder/root/build/release/examples/quickstart.png"

echo "$failures failures"
[ $failures = 0 ]

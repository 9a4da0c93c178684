#!/usr/bin/env bash
# What an installation promises besides its CMake package: check.sh PREFIX FOLDER. FOLDER takes what
# is built.
set -euo pipefail
tests=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
prefix=$(readlink -f "$1")
mkdir -p "$2"
dir=$(readlink -f "$2")
pc=$(dirname "$(find "$prefix" -name dashpot-analysis.pc)")
export PKG_CONFIG_PATH=$pc LD_LIBRARY_PATH=${pc%/pkgconfig}
shared=$prefix/share/dashpot

fail() {
  echo "consumer: $*" >&2
  exit 1
}

same_version() {
  local file said
  said=$("$prefix/bin/dashpot" --version)
  for file in "$pc"/dashpot-*.pc; do
    pkg-config --exists --print-errors "$(basename "$file" .pc)" || fail "$file is no good"
    [[ $said == "dashpot $(pkg-config --modversion "$(basename "$file" .pc)")" ]] ||
      fail "$file is of another version than $said"
  done
}

examples() { # as examples/README.md says, for the plainest processor
  local name flags
  for name in spectrum control_loop; do
    read -ra flags <<<"$(pkg-config --cflags --libs dashpot-controller)"
    c++ -std=c++20 "$shared/examples/$name.cpp" "${flags[@]}" -o "$dir/$name"
    (cd "$shared" && python3 "$tests/examples/check.py" "$tests/examples/$name.txt" "$dir/$name")
  done
  read -ra flags <<<"$(pkg-config --cflags --libs dashpot-plugin)"
  cc -std=c99 "$shared/examples/plugin.c" "${flags[@]}" -o "$dir/plugin"
  (cd "$shared" && python3 "$tests/examples/check.py" "$tests/examples/plugin_c.txt" "$dir/plugin" \
    controller/examples/panda.yaml)
  read -ra flags <<<"$(pkg-config --cflags --libs dashpot-publisher)"
  cc -std=c99 "$shared/examples/publisher.c" "${flags[@]}" -o "$dir/publisher"
  (cd "$shared" && LCM_DEFAULT_URL="file://$dir/arm.lcm?mode=w" python3 "$tests/examples/check.py" \
    "$tests/examples/publisher_c.txt" "$dir/publisher" controller/examples/panda.yaml)
  grep -aq DASHPOT_MODES "$dir/arm.lcm" || fail "publisher.c published nothing"
}

program() { # finds its plugin, and what is installed beside it
  (cd "$shared" && "$prefix/bin/dashpot" run sim/scenes/panda.yaml --fast --duration 0.01 >/dev/null)
  (cd "$shared" && "$prefix/bin/dashpot" analyze apps/examples/chain3.yaml >/dev/null)
}

wrong_component() {
  local said
  if said=$(cmake -S "$tests/consumer" -B "$dir/wrong" -DCMAKE_PREFIX_PATH="$prefix" \
    -DCONSUMER_MORE=vibrations 2>&1); then
    fail "find_package found a component that there is not"
  fi
  [[ $said == *"no component 'vibrations'"* ]] || fail "no word of the wrong component: $said"
}

wrong_alignment() { # each header that shows Eigen's types stops the compiler
  local header said flags includes
  read -ra includes <<<"$(pkg-config --cflags-only-I dashpot-lcmtypes dashpot-sim)"
  while read -r header; do
    if said=$(c++ -std=c++20 -E "${includes[@]}" "$header" 2>&1); then
      [[ $said != *Eigen/Core* ]] || fail "$header can be compiled with another alignment"
    else
      [[ $said == *"add -DEIGEN_MAX_ALIGN_BYTES=64"* ]] || fail "$header: $said"
    fi
  done < <(find "$prefix/include/dashpot" -name '*.hpp')
  read -ra flags <<<"$(pkg-config --cflags dashpot-lcmtypes)"
  c++ -std=c++20 -fsyntax-only "${flags[@]}" "$tests/consumer/main.cpp"
}

same_version
examples
program
wrong_component
wrong_alignment
echo "consumer: pkg-config, examples, components and alignment are as they should be"

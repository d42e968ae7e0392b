#!/bin/sh
# Installs the C interface under PREFIX: header, static and shared library, pkg-config file.
#     crates/capi/install.sh PREFIX [FOLDER]
# FOLDER holds libraries that are built already. DESTDIR is put before PREFIX, for those who make packages.
# On Windows, take rthstrack_c.dll and rthstrack_c.lib out of target/release, and the header from here.
set -eu

[ $# -ge 1 ] && [ $# -le 2 ] || { echo "usage: $0 PREFIX [FOLDER]"; exit 2; }
case $1 in /*) prefix=$1 ;; *) prefix=$PWD/$1 ;; esac
case ${2-} in "" | /*) built=${2-} ;; *) built=$PWD/$2 ;; esac
cd "$(dirname "$0")/../.."

version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)
abi=$(sed -n 's/^#define RTHSTRACK_ABI_VERSION //p' crates/capi/include/rthstrack.h)
if [ "$(uname)" = Darwin ]; then
    shared=librthstrack_c.dylib versioned=librthstrack_c.$abi.dylib
    name=-Wl,-install_name,$prefix/lib/$versioned
else
    shared=librthstrack_c.so versioned=librthstrack_c.so.$abi
    name=-Wl,-soname,$versioned
fi

if [ -z "$built" ]; then
    cargo rustc --package rthstrack-capi --lib --release --locked --crate-type cdylib,staticlib -- -C "link-arg=$name"
    built=${CARGO_TARGET_DIR:-target}/release
fi

# What a program needs that carries the Rust library within itself, as the compiler says.
empty=$(mktemp -d)
trap 'rm -rf "$empty"' EXIT
native=$(: | rustc --crate-type staticlib --crate-name empty --print native-static-libs -o "$empty/empty.a" - 2>&1 \
    | sed -n 's/^note: native-static-libs: //p')
[ -n "$native" ] || { echo "$0: rustc did not say which libraries its own needs"; exit 1; }

root=${DESTDIR-}$prefix
mkdir -p "$root/include" "$root/lib/pkgconfig"
cp crates/capi/include/rthstrack.h "$root/include/"
cp "$built/librthstrack_c.a" "$root/lib/"
# Not written over: a program that runs keeps the file that it has.
rm -f "$root/lib/$versioned"
cp "$built/$shared" "$root/lib/$versioned"
ln -sf "$versioned" "$root/lib/$shared"
sed -e "s|@PREFIX@|$prefix|; s|@VERSION@|$version|; s|@NATIVE@|$native|" crates/capi/rthstrack.pc.in \
    > "$root/lib/pkgconfig/rthstrack.pc"
echo "rthstrack $version installed under $root"

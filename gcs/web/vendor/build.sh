#!/usr/bin/env bash
# Makes the files of this folder anew from the packages of the versions below. Needs node and npm; whoever uses
# Plumbline never runs this. The same versions give the same bytes.
set -euo pipefail
THREE=0.187.0
UPLOT=1.6.32
ESBUILD=0.28.2

here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
echo '{"private": true}' > package.json
npm install --silent --no-save --ignore-scripts "three@$THREE" "uplot@$UPLOT" "esbuild@$ESBUILD"
cp "$here/three.entry.js" .
npx --no-install esbuild three.entry.js --bundle --minify --format=iife --global-name=THREE \
    --legal-comments=inline --charset=ascii --banner:js="/* three.js $THREE, MIT licence: see three.LICENSE */" \
    --outfile="$here/three.min.js"
cp node_modules/uplot/dist/uPlot.iife.min.js "$here/uplot.min.js"
cp node_modules/uplot/dist/uPlot.min.css "$here/uplot.min.css"
cp node_modules/three/LICENSE "$here/three.LICENSE"
cp node_modules/uplot/LICENSE "$here/uplot.LICENSE"
# a page carries these files within its own text
if grep -il '</script' "$here"/*.min.js; then
    echo "the files named above would end the <script> that holds them" >&2
    exit 1
fi

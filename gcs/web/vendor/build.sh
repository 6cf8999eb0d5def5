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
    --legal-comments=none --charset=ascii --outfile=three.js --log-level=warning
# who copies a page copies the licences within it
carried() { # NAME VERSION LICENCE FILE: the file under its licence
    printf '/*! %s %s\n' "$1" "$2"
    tr -d '\r' < "$3"
    printf '*/\n'
    cat "$4"
}
carried three.js "$THREE" node_modules/three/LICENSE three.js > "$here/three.min.js"
carried uPlot "$UPLOT" node_modules/uplot/LICENSE node_modules/uplot/dist/uPlot.iife.min.js > "$here/uplot.min.js"
cp node_modules/uplot/dist/uPlot.min.css "$here/uplot.min.css"
# a page carries these files within its own text
if grep -il '</script' "$here"/*.min.js; then
    echo "the files named above would end the <script> that holds them" >&2
    exit 1
fi

#!/bin/sh
# Writes src/protocol.ts anew from src/interpose/studio/protocol.py; PYTHON names the interpreter.
set -eu
cd "$(dirname "$0")"
"${PYTHON:-python}" protocol_schema.py | node_modules/.bin/json2ts --no-additionalProperties \
    --bannerComment '/* Made from src/interpose/studio/protocol.py by web/protocol.sh; do not edit. */' \
    > "${1:-src/protocol.ts}"

"""Check that everything public has a known type: python .ci/check_types.py FILE

FILE holds what `basedpyright --verifytypes airhockey_env --outputjson` printed.
"""

import json
import sys
from pathlib import Path

import airhockey_env

symbols = json.loads(Path(sys.argv[1]).read_text())["typeCompleteness"]["symbols"]
known = {symbol["name"]: symbol["isTypeKnown"] and not symbol["isTypeAmbiguous"] for symbol in symbols}
public = [f"airhockey_env.{name}" for name in airhockey_env.__all__ if not name.startswith("__")]
incomplete = [name for name in public if not known[name]]
if incomplete:
    for symbol in symbols:
        for diagnostic in symbol["diagnostics"]:
            print(symbol["name"], diagnostic["message"].replace("\n", " "))
    sys.exit(f"not all of the types of these are known: {', '.join(incomplete)}")
print(f"the types of all {len(public)} public names are known")

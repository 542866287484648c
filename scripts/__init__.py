"""Thin commands over agents/ and airhockey_env/, used from a checkout: python -m scripts.NAME --help"""

from importlib.util import find_spec

_missing = [name for name in ("tyro", "rich", "tqdm", "torch", "stable_baselines3") if find_spec(name) is None]
if _missing:
    raise SystemExit(f'the scripts need {", ".join(_missing)}: pip install -c constraints.txt -e ".[train]"')

"""Thin commands over agents/ and airhockey_env/, used from a checkout: python -m scripts.NAME --help"""

from agents.extras import need

need("the scripts", "tyro", "rich", "tqdm")

"""The page on which one plays without a server; docs/web.md describes it."""

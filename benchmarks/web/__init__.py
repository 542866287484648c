"""The browser's pages and their server: pictures of them, how late they are, and how many play at a time."""

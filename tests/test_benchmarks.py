"""Blocks of docs/bench are complete, and not too far behind the code they measure."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.bench import blocks

PAGE = """# Page

**one** · made at `1234567` · measures `pipeline`

```sh
echo 1
```

```
old
```

**two** · made at `7654321` · measures `server` `hardware/link`

```sh
echo 2
```

| a | table |
"""


def history_is_whole() -> bool:
    """Whether this tree has its commits (a shallow clone or an archive lacks them)."""
    try:
        return blocks.git("rev-parse", "--is-shallow-repository") == "false"
    except (OSError, subprocess.CalledProcessError):
        return False


def test_a_block_is_its_name_commit_paths_and_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "page.md").write_text(PAGE)
    monkeypatch.setattr(blocks, "PAGES", tmp_path)
    one, two = blocks.blocks()
    assert (one.name, one.commit, one.paths, one.command) == (
        "one",
        "1234567",
        ("pipeline",),
        "echo 1",
    )
    assert (two.name, two.paths) == ("two", ("server", "hardware/link"))


def test_only_a_block_s_own_output_and_commit_are_made_anew() -> None:
    again = blocks.replaced(PAGE, "one", "new\nlines\n", "abcdef0")
    assert again == PAGE.replace("1234567", "abcdef0").replace("old", "new\nlines")
    for name in ("two", "three"):
        with pytest.raises(blocks.BlockError, match=name):
            blocks.replaced(PAGE, name, "new", "abcdef0")


def test_each_block_of_the_documents_names_what_exists() -> None:
    found = blocks.blocks()
    assert len({block.name for block in found}) == len(found) > 20
    assert [
        (block.name, path)
        for block in found
        for path in block.paths
        if not (blocks.ROOT / path).exists()
    ] == []


def test_each_block_was_made_at_a_commit_of_this_branch() -> None:
    """One that was amended away is still found beside it, and by no one who clones."""
    if not history_is_whole():
        return  # an archive of the tree cannot tell
    history = blocks.git("rev-list", "HEAD").split()
    assert [
        (block.name, block.commit)
        for block in blocks.blocks()
        if not any(commit.startswith(block.commit) for commit in history)
    ] == []


def test_no_block_is_further_behind_its_code_than_is_stated() -> None:
    if not history_is_whole():
        return  # an archive of the tree cannot tell
    behind = {block.name: block.behind for block in blocks.blocks()}
    assert max(behind.values()) <= blocks.MOST_BEHIND, behind

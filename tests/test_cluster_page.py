"""docs/cluster.md: its commands have these options, and its files for clusters are well-formed and of our versions."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from importlib import import_module
from typing import Any

import pytest
import tyro

from tests.helpers import ROOT
from tests.pages import blocks

yaml = pytest.importorskip("yaml")

PAGE = ROOT / "docs" / "cluster.md"
TEXTS = {block.language: block.code for block in blocks(PAGE) if block.language in ("slurm", "yaml", "dockerfile")}

SPEC = {"entrypoint", "shutdownAfterJobFinishes", "rayClusterSpec"}
"""Fields of a RayJob's spec: ray-operator/apis/ray/v1/rayjob_types.go of ray-project/kuberay."""


def commands() -> list[str]:
    """Every command of ours on the page, on one line and without what a shell computes."""
    text = "\n".join(block.code for block in blocks(PAGE)).replace("\\\n", " ")
    text = re.sub(r'"?\$\(\([^)]*\)\)"?', "8", text)
    text = re.sub(r"\[(--[^]]*)\]", r"\1", text)  # options that may be left out
    return [line.strip(' "') for line in re.findall(r"python (-m scripts\.\w+[^\n#]*)", text)]


@pytest.mark.parametrize("line", commands())
def test_a_command_has_these_options(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    _, name, *words = shlex.split(line)
    read: list[Any] = []
    module = import_module(name)
    monkeypatch.setattr(module, "run_command", lambda _, arguments, *__: read.append(tyro.cli(arguments, args=words)))
    module.main()
    assert read


@pytest.mark.skipif(os.name == "nt", reason="needs bash")
def test_the_slurm_script_is_a_script() -> None:
    subprocess.run(["bash", "-n"], input=TEXTS["slurm"], text=True, check=True)
    options = dict(line[len("#SBATCH --") :].split("=") for line in TEXTS["slurm"].splitlines() if "#SBATCH" in line)
    assert options["ntasks-per-node"] == "1", "ray symmetric-run starts one Ray on each node"


def test_the_manifest_is_a_ray_job() -> None:
    job = yaml.safe_load(TEXTS["yaml"])
    assert (job["apiVersion"], job["kind"]) == ("ray.io/v1", "RayJob")
    assert set(job["spec"]) == SPEC
    cluster = job["spec"]["rayClusterSpec"]
    (group,) = cluster["workerGroupSpecs"]
    pods = [part["template"]["spec"] for part in (cluster["headGroupSpec"], group)]
    for pod in pods:
        (container,) = pod["containers"]
        mounted = {mount["name"] for mount in container["volumeMounts"]}
        assert mounted == {volume["name"] for volume in pod["volumes"]}
        assert container["resources"]["limits"] == container["resources"]["requests"]
    processors = int(pods[1]["containers"][0]["resources"]["limits"]["cpu"])
    workers = int(re.search(r"--workers (\d+)", job["spec"]["entrypoint"])[1])  # type: ignore[index]
    assert workers == group["replicas"] * processors
    assert pods[0]["containers"][0]["image"] == pods[1]["containers"][0]["image"]


def test_the_versions_are_ours() -> None:
    constraints = (ROOT / "constraints-distributed.txt").read_text()
    version = re.search(r"^ray==(.*)$", constraints, re.MULTILINE)[1]  # type: ignore[index]
    found = re.findall(r"ray:([\d.]+)|rayVersion: \"([\d.]+)\"|ray\[default\]==([\d.]+)", PAGE.read_text())
    assert len(found) == 3
    assert {next(filter(None, one)) for one in found} == {version}

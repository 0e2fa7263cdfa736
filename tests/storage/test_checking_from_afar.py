"""``fedora-qa check`` of a URL: the record of the file itself, from less than the file; and no secret anywhere."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from distributed import LocalCluster
from s3fs import S3FileSystem

from fedora_qa.cli.main import run
from fedora_qa.storage.digest import file_digest
from fedora_qa.storage.place import place_of
from tests.storage.conftest import BUCKET
from tests.support.servers import FileServer

SELECTED = ("--select", "clocks", "--select", "imu", "--select", "integrity")


def check(*arguments: str | Path) -> int:
    return run(["check", *(str(argument) for argument in (*arguments, *SELECTED))])


def found(path: Path) -> dict[str, Any]:
    """What a record says of its file, but for where it lies and what only a server tells."""
    file: dict[str, Any]
    (file,) = json.loads(path.read_text(encoding="utf-8"))["files"]
    for name in ("path", "sha256", "digest_kind"):
        del file[name]
    file["inferred"].pop("storage.version", None)
    return file


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_the_record_is_that_of_the_file(jobs: str, server: FileServer, tmp_path: Path) -> None:
    """Over HTTP, in one process or two, the same is found; the run says what was transferred."""
    here, there = tmp_path / "here.json", tmp_path / "there.json"
    assert (
        check(tmp_path / "seq.h5", "--json", here) == check(server.url("seq.h5"), "--jobs", jobs, "--json", there) == 0
    )
    assert found(there) == found(here)
    host = json.loads(there.read_text())["run"]["host"]
    assert 0 < host["transferred_bytes"] <= server.sent_bytes
    assert 0 < host["requests"] <= server.requests
    assert "transferred_bytes" not in json.loads(here.read_text())["run"]["host"]


def test_workers_of_a_cluster_open_the_url(server: FileServer, tmp_path: Path) -> None:
    """A worker of a Dask cluster opens the URL itself, and the same is found; it tells what it transferred."""
    here, there = tmp_path / "here.json", tmp_path / "there.json"
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0", host="127.0.0.1") as cluster:  # type: ignore[no-untyped-call]
        remotely = check(server.url("seq.h5"), "--dask", cluster.scheduler_address, "--json", there)
    assert check(tmp_path / "seq.h5", "--json", here) == remotely == 0
    assert found(there) == found(here)
    assert 0 < json.loads(there.read_text())["run"]["host"]["transferred_bytes"] <= server.sent_bytes


def test_an_object_of_a_bucket(bucket: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same from an S3-compatible server; its version is named, and the summary says what was transferred."""
    here, there = tmp_path / "here.json", tmp_path / "there.json"
    assert check(tmp_path / "seq.h5", "--json", here) == check(f"s3://{BUCKET}/seq.h5", "--json", there) == 0
    assert found(there) == found(here)
    (file,) = json.loads(there.read_text())["files"]
    assert file["inferred"]["storage.version"] == bucket.head_object(Bucket=BUCKET, Key="seq.h5")["ETag"]
    assert file["digest_kind"] == "partial"
    assert " requests\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("url", "told"), [(f"s3://{BUCKET}/none.h5", "does not exist"), ("s3://none/seq.h5", "does not exist")]
)
def test_no_such_object(url: str, told: str, bucket: Any, capsys: pytest.CaptureFixture[str]) -> None:
    """An object or a bucket that is not there is misuse, in one sentence."""
    assert check(url) == 2
    err = capsys.readouterr().err
    assert told in err
    assert err.count("\n") == 1


def test_without_credentials(
    bucket: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the environment has none, it is said how they are given."""
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    S3FileSystem.clear_instance_cache()  # one that has credentials already
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", str(tmp_path / "none"))
    monkeypatch.setenv("AWS_CONFIG_FILE", str(tmp_path / "none"))
    assert check(f"s3://{BUCKET}/seq.h5") == 2
    assert "AWS_ACCESS_KEY_ID" in capsys.readouterr().err


def test_a_public_bucket(bucket: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without credentials, where the environment says that none are wanted; fsspec reads it when it is loaded."""
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("FSSPEC_S3_ANON", "true")
    bucket.copy_object(
        Bucket=BUCKET, Key="public.h5", CopySource={"Bucket": BUCKET, "Key": "seq.h5"}, ACL="public-read"
    )
    code = "import sys; from fedora_qa.cli.main import run; print(run(sys.argv[1:]), flush=True)"
    both = f"{code}; sys.argv[2] = 's3://{BUCKET}/public.h5'; print('then', run(sys.argv[1:]))"
    command = [sys.executable, "-c", both, "check", f"s3://{BUCKET}/seq.h5", *SELECTED]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.stdout.startswith("2\n")
    assert done.stdout.endswith("then 0\n")
    assert "access to the file, got a refusal (403)" in done.stderr
    assert done.stderr.count("\n") == 1


def test_secrets_are_in_no_output(server: FileServer, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Password and signature are used, and appear in no record, report or line of text."""
    server.authorization = "Basic dXNlcjpodXNoaHVzaA=="
    url = server.url("seq.h5").replace("://", "://user:hushhush@") + "?X-Amz-Signature=hushhush"
    names = ("json", "html", "markdown", "junit", "sarif")
    outputs = [part for name in names for part in (f"--{name}", tmp_path / f"out.{name}")]
    assert check(url, *outputs, "--resume", tmp_path / "kept") == 0
    assert check(url, *outputs, "--resume", tmp_path / "kept") == 0
    assert check(url.replace("user:hushhush", "user:hushhush2")) == 2
    said = capsys.readouterr()
    written = [path.read_bytes().decode("utf-8", "replace") for path in tmp_path.rglob("*") if path.is_file()]
    assert len(written) > len(names)
    for text in (said.out, said.err, *written):
        assert "hushhush" not in text
    assert "seq.h5" in said.out


def test_what_is_kept_is_of_one_version(server: FileServer, tmp_path: Path) -> None:
    """A file that is as it was is not checked again; one that was written again is, though its pieces are the same."""
    kept = ("--resume", tmp_path / "kept")
    check(server.url("seq.h5"), *kept)
    first = server.sent_bytes
    check(server.url("seq.h5"), *kept)
    resumed = server.sent_bytes - first
    (tmp_path / "seq.h5").touch()
    check(server.url("seq.h5"), *kept)
    assert server.sent_bytes - first - resumed > 2 * resumed


def test_a_change_meanwhile(
    server: FileServer, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that becomes another while it is checked gives no record, and is not called damaged."""

    def digest_then_change(place: Any) -> Any:
        digest = file_digest(place)
        (server.folder / "seq.h5").touch()
        return digest

    monkeypatch.setattr("fedora_qa.engine.survey.file_digest", digest_then_change)
    assert check(server.url("seq.h5")) == 2
    said = capsys.readouterr()
    assert said.err.count("got a change; check it again") == 1
    assert not said.out


def test_the_digest_is_the_same_wherever_a_long_file_lies(server: FileServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the length on at which only pieces are read, a copy on a disk has the digest of the one behind a URL."""
    monkeypatch.setattr("fedora_qa.storage.digest._WHOLE_UP_TO_BYTES", 16 * 64 * 16)
    monkeypatch.setattr("fedora_qa.storage.digest._PIECE_BYTES", 16)
    here, there = file_digest(server.folder / "seq.h5"), file_digest(place_of(server.url("seq.h5")))
    assert (here.sha256, here.kind) == (there.sha256, there.kind)
    assert there.traffic.transferred_bytes == 64 * 16


def test_a_file_that_is_damaged_where_it_lies(server: FileServer, capsys: pytest.CaptureFixture[str]) -> None:
    """A truncated file is a finding, as on a disk; what is no HDF5 is misuse."""
    content = (server.folder / "seq.h5").read_bytes()
    (server.folder / "short.h5").write_bytes(content[: len(content) // 2])
    (server.folder / "text.h5").write_bytes(b"text")
    assert check(server.url("short.h5")) == 1
    assert "truncated" in capsys.readouterr().out
    assert check(server.url("text.h5")) == 2
    assert "no HDF5 signature" in capsys.readouterr().err


POLICY = """
ruleset_version = "2"
files = ["**/*.h5"]
required_streams = ["imu"]
naming = '(train|test)/[a-z]+\\.h5'
same_sequence = true
[documents]
licence = "LICENSE"
[check]
select = ["clocks", "integrity"]
"""


@pytest.fixture
def release(bucket: Any, folder: Path) -> str:
    """A prefix with two sequences in folders, a document, a hidden object and one of another kind."""
    content = (folder / "seq.h5").read_bytes()
    for key, body in {
        "v1/train/a.h5": content,
        "v1/test/b.h5": content,
        "v1/LICENSE": b"CC BY 4.0\n",
        "v1/.cache/c.h5": b"",
        "v1/notes.txt": b"none",
    }.items():
        bucket.put_object(Bucket=BUCKET, Key=key, Body=body)
    return f"s3://{BUCKET}/v1/"


def test_all_sequences_below_a_prefix_are_checked(release: str, tmp_path: Path) -> None:
    assert check(release, "--json", tmp_path / "out.json") == 0
    files = json.loads((tmp_path / "out.json").read_text())["files"]
    assert [file["path"] for file in files] == [f"{release}test/b.h5", f"{release}train/a.h5"]


def test_a_prefix_without_sequences(bucket: Any, capsys: pytest.CaptureFixture[str]) -> None:
    bucket.put_object(Bucket=BUCKET, Key="empty/notes.txt", Body=b"none")
    assert check(f"s3://{BUCKET}/empty/") == 2
    assert "got 1 other objects" in capsys.readouterr().err
    assert check("s3://no-such-bucket/empty/") == 2


def test_a_prefix_is_held_to_a_policy(release: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its sequences and its documents; nothing that needs every byte."""
    policy, out = tmp_path / "policy.toml", tmp_path / "out.json"
    policy.write_text(POLICY)
    assert run(["gate", release, "--policy", str(policy), "--json", str(out)]) == 0
    files = json.loads(out.read_text())["files"]
    assert [file["path"] for file in files] == [f"{release}test/b.h5", f"{release}train/a.h5", release]
    policy.write_text(POLICY.replace("LICENSE", "DATASHEET.md").replace("(train|test)", "train"))
    assert run(["gate", release, "--policy", str(policy), "--json", str(out)]) == 1
    codes = {finding["code"] for file in json.loads(out.read_text())["files"] for result in file["results"]
             for finding in result["findings"]}  # fmt: skip
    assert {"release.documents.licence", "release.naming.pattern"} <= codes
    capsys.readouterr()
    assert run(["gate", release, "--policy", str(policy), "--certificate", str(tmp_path / "c.json")]) == 2
    assert "every byte is read" in capsys.readouterr().err
    assert run(["gate", release.rstrip("/"), "--policy", str(policy)]) == 2
    assert "a prefix (s3://bucket/prefix/)" in capsys.readouterr().err


def test_a_cluster_gates_a_folder(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same record as without it, but for its run."""
    policy, here, there = (folder / name for name in ("policy.toml", "here.json", "there.json"))
    policy.write_text('ruleset_version = "2"\nfiles = ["*.h5"]\n[check]\nselect = ["clocks"]\n')
    gate = ("gate", str(folder), "--policy", str(policy), "--json")
    assert run([*gate, str(here)]) == 0
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0", host="127.0.0.1") as cluster:  # type: ignore[no-untyped-call]
        assert run([*gate, str(there), "--dask", cluster.scheduler_address]) == 0
        assert run([*gate, str(there), "--dask", cluster.scheduler_address, "--jobs", "2"]) == 2
    assert "either --jobs or --dask" in capsys.readouterr().err
    assert json.loads(here.read_text())["files"] == json.loads(there.read_text())["files"]

"""A slice of prove_limits.py: no bomb takes more memory than is allowed, and each ends in records or a refusal.

One that takes more than 30 s of processor time is stopped, which is a failure.
"""

from __future__ import annotations

import resource
from collections.abc import Iterator

import pytest
from fuzz_bombs import BOMBS
from fuzz_judge import Judge
from prove_limits import LIMIT_MB, Account, accounted, bomb, table


@pytest.fixture(scope="module")
def judge(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Judge]:
    return Judge(tmp_path_factory.mktemp("limits"))


@pytest.mark.parametrize("number", range(len(BOMBS)))
def test_no_bomb_takes_more_than_is_allowed(judge: Judge, number: int) -> None:
    own_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6  # a child begins with its parent's
    account = bomb(judge, number, seed=2)
    assert not account.has_failed, account.said
    assert account.peak_mb - own_mb <= LIMIT_MB


def test_an_account_has_the_memory_and_the_end_of_its_job() -> None:
    def large() -> str:
        return "accepted" if bytearray(300_000_000) else ""

    small, big, bad = accounted(["a", "b", "c"], [lambda: "refused E206", large, lambda: str(1 // 0)])
    assert small.said == "refused E206"
    assert big.peak_mb - small.peak_mb > 250
    assert bad.has_failed
    assert "ZeroDivisionError" in bad.said
    assert Account("a", "accepted", 11.0, 0.0, 100.0).is_over
    assert "| all | 3 | 1 | 1 | 1 |" in table([small, big, bad])

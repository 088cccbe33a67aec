"""Commands leave the other cores to others."""

import pytest


@pytest.mark.parametrize(("given", "taken"), [(None, "1"), ("3", "3")])
def test_a_command_takes_one_thread_of_linear_algebra_unless_told(run_python, given, taken):
    said = run_python(
        "import os\n"
        f"given = {given!r}\n"
        "os.environ.pop('OPENBLAS_NUM_THREADS', None)\n"
        "if given: os.environ['OPENBLAS_NUM_THREADS'] = given\n"
        "from schuler.cli import main\n"
        "try:\n    main(['--version'])\nexcept SystemExit: pass\n"
        "print(os.environ['OPENBLAS_NUM_THREADS'])"
    )
    assert said.splitlines()[-1] == taken

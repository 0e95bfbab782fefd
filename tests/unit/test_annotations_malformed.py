"""Every malformed file is caught, with its code and line."""

import pytest
from label_corpus import FOLDER, corpus, sequence

from card.annotations.import_labels import read_annotations
from card.annotations.issues import SEVERITIES

CORPUS = corpus()


@pytest.mark.parametrize("name", CORPUS)
def test_issues_carry_file_line_and_code(name):
    boxes, _, issues = read_annotations(FOLDER / name, sequence(), "auto")
    assert [(issue.file, issue.line, issue.code) for issue in issues] == sorted(CORPUS[name])
    if any(code == "unmarked_image" for _, _, code in CORPUS[name]):
        assert boxes == {}


def test_every_folder_is_listed():
    folders = {path.name for path in FOLDER.iterdir() if path.is_dir()}
    assert folders == set(CORPUS)
    assert len(folders) >= 40


def test_errors_are_all_there():
    found = {code for issues in CORPUS.values() for _, _, code in issues}
    assert found >= {code for code, severity in SEVERITIES.items() if severity == "error"}

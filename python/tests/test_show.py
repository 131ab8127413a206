# SPDX-License-Identifier: BSD-3-Clause
"""The page of a model in a notebook."""

import html
import html.parser

import holba
import pytest


class Frames(html.parser.HTMLParser):
    """The frames of a cell's output, as a browser would read their attributes."""

    def __init__(self, text):
        super().__init__()
        self.frames = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        if tag == "iframe":
            self.frames.append(dict(attributes))


def test_a_notebook_gets_one_frame_that_holds_the_page_of_the_program(model, tmp_path):
    shown = model.show(height_px=450)
    (frame,) = Frames(shown._repr_html_()).frames
    holba.view(model, tmp_path / "view.html")
    page = (tmp_path / "view.html").read_bytes().decode()
    assert page.lstrip().lower().startswith("<!doctype html>")
    # The title is that of the folder that the model was read from, so that the rest is compared.
    assert len(frame["srcdoc"]) == pytest.approx(len(page), abs=200)
    assert frame["srcdoc"] == shown.page
    assert frame["height"] == "450"
    # A script of its own and nothing else: no access to the notebook.
    assert "allow-scripts" in frame["sandbox"] and "allow-same-origin" not in frame["sandbox"]


def test_the_page_can_be_written_and_compares_models(model, scene, tmp_path):
    alone, both = model.show(), holba.show(model, compare_path=scene / "truth")
    assert len(both.page) > len(alone.page)
    both.write(tmp_path / "both.html")
    with open(tmp_path / "both.html", encoding="utf-8", newline="") as file:
        assert file.read() == both.page
    assert repr(both).startswith("View(")


def test_a_wrong_option_is_refused_by_name(model):
    with pytest.raises(holba.InputError, match="max_model_mb"):
        model.show(max_model_mb=-1)

"""The studio as a user works with it, in a browser."""

import urllib.error
import urllib.request

import pytest


def test_without_the_token_nothing_is_answered(studio):
    address = studio[0]
    for wrong in (address.rsplit("/", 2)[0] + "/", address[:-3] + "xx/", address[:-3] + "xx/ws"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(wrong)
        assert refused.value.code == 403
        refused.value.close()


def test_blocks_are_dropped_and_edited_by_their_forms(page, studio):
    page.goto(f"{studio[0]}?new")
    page.wait_for_selector(".react-flow__pane")
    page.wait_for_function("Bokeh.documents[0].is_idle")
    canvas = page.locator(".react-flow__pane")
    page.locator('button[data-kind="driver.crank"]').drag_to(canvas)
    page.locator(".react-flow__node").first.wait_for()
    field = page.get_by_label("length [m]", exact=True)
    field.fill("-2")
    field.press("Enter")
    page.get_by_text("length must be > 0 m, got -2").first.wait_for()
    assert page.locator(".react-flow__node.bm-driver").count() == 1

"""JSON in a script element neither ends the element nor changes its meaning."""

import json

from hypothesis import given, strategies as st

from drake_shared.common.html import script_safe


@given(st.dictionaries(st.text(), st.text() | st.sampled_from(["</script>", "<!--<script>", "a < b"])))
def test_the_text_cannot_end_its_element_and_means_the_same(value):
    text = script_safe(json.dumps(value))
    assert "<" not in text
    assert json.loads(text) == value

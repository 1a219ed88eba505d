from html.parser import HTMLParser


class Tags(HTMLParser):
    def __init__(self):
        super().__init__()
        self.tags = []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))


def test_notebook_shows_verdict_errors_and_a_picture(result):
    html = result._repr_html_()
    parser = Tags()
    parser.feed(html)
    pictures = [attributes for tag, attributes in parser.tags if tag == "img"]
    assert pictures[0]["src"].startswith("data:image/png;base64,iVBOR")
    assert "zero offset of joint 2" in html
    assert f"{1e3 * result.after.rms_m:.3f} mm" in html

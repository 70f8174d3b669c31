"""What a hand does to a sheet, without a browser: acts, and what is said to them."""

from blockmech.editor import drawing
from blockmech.editor.acts import acted
from blockmech.editor.pins import pins_of
from blockmech.editor.revision import Question
from blockmech.editor.sheets import Sheet
from blockmech.ground.errors import BlockmechError


class Hand:
    """A sheet under a hand; ``said`` is the last refusal, or what the sheet is."""

    def __init__(self, document=None, folder=None):
        self.sheet = Sheet(document, folder)
        self.said = ""

    @property
    def form(self):
        return self.sheet.form

    @property
    def problems(self):
        return self.sheet.now.problems

    @property
    def mechanism(self):
        return self.sheet.now.mechanism

    @property
    def drawn(self):
        return pins_of(self.form)

    def do(self, act, **request):
        try:
            self.sheet.change(*acted(self.sheet.now, {"act": act, **request}))
        except BlockmechError as error:
            self.said = str(error)
        else:
            self.said = drawing.status_of(self.sheet.now)

    def act(self, name, *pins, **options):
        self.do(name, pins=list(pins), **options)

    def add(self, *positions):
        for z in positions:
            self.do("pin", at=[complex(z).real, complex(z).imag])

    def ask(self, **data):
        return Question(self.sheet.now, data)

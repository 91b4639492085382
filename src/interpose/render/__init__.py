"""Pictures of motions as PNG files, drawn with NumPy and Pillow."""

from interpose.render.sheet import Row as Row
from interpose.render.sheet import contact_sheet as contact_sheet
from interpose.render.sheet import scene as scene

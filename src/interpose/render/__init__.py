"""Pictures of motions as PNG files, drawn with NumPy and Pillow."""

from interpose.render.sheet import SheetRow as SheetRow
from interpose.render.sheet import compose as compose
from interpose.render.sheet import contact_sheet as contact_sheet
from interpose.render.sheet import draw_rows as draw_rows
from interpose.render.sheet import save as save

"""armkin's firmware onto a board, from what is installed.

firmware_images.py  the images that a release holds, and their checksums
intel_hex.py        their words for AVR chips
stk500v1.py         the boot loader of the Uno; stk500v2.py: of the Mega
avrdude.py          the uploader that many have, used where it is on PATH
boot_drive.py       the drive that a Pico is in BOOTSEL
upload_firmware.py  which of them a board takes, and the board's own word at the end
"""

from armkin.flash.firmware_images import Image, image
from armkin.flash.upload_firmware import FlashResult, upload

__all__ = ["FlashResult", "Image", "image", "upload"]

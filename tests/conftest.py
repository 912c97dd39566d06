"""Its being here puts this folder on the import path: helpers such as `command_line` are modules in it."""

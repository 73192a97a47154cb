"""How often an explanation is right, on concealed cases of an independent generator."""

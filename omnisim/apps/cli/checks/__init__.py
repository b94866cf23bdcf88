"""Commands that check omnisim itself."""

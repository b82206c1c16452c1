"""The methods of the literature, each in the form that its paper gives."""

"""What a page concludes, and what it rests on: rules, the cross-check, conventions."""

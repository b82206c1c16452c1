"""The slow errors of the gyros: how they walk, what they follow, and what is known of them beforehand."""

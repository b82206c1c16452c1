"""vgyro's own methods: what the other folders find, put together."""

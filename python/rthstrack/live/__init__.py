"""The on-line monitor: what stands around the compiled `Live`. `page` shows a run in browsers."""

"""Heights of objects on a plane, as `shape_ball` of the core gives one."""

"""Names of Orbit and Isaac Lab, in the generation of the sensor tutorial: quaternions w x y z, images without a channel
axis for depth, colors RGBA.

Replace ``omni.isaac.orbit`` by ``kinetoscope.compat.isaaclab`` in the import lines of a script.
"""

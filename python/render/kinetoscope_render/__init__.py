"""Images of MuJoCo models without a GPU and without OpenGL.

`Renderer` has the interface of `mujoco.Renderer`. `BatchRenderer` renders many states at once. `patch_mujoco` puts them
in the place of the renderers of `mujoco`, Gymnasium, dm_control and robosuite. `python -m kinetoscope_render doctor`
checks an installation.

    import kinetoscope_render as kr

    with kr.Renderer(model, 480, 640) as renderer:
        renderer.update_scene(data, camera="side")
        rgb = renderer.render()                       # uint8, (480, 640, 3)
"""

from kinetoscope_render._render import __version__
from kinetoscope_render.batch import BatchRenderer
from kinetoscope_render.patch import patch_mujoco, unpatch_mujoco
from kinetoscope_render.renderer import Renderer

__all__ = ["BatchRenderer", "Renderer", "__version__", "patch_mujoco", "unpatch_mujoco"]

//! Lights, headlight and sky of MuJoCo models.

use crate::entity_set::EntitySet;
use crate::light_cfg::{LightCfg, LightKindCfg};
use crate::mjcf::scene_names::light_name;
use crate::simulation_cfg::SimulationManagerCfg;
use kinetoscope_look::{LightType, first_skybox, horizon_haze, linear_light, scene_headlight, scene_light, skybox};
use kinetoscope_mujoco::{Data, Model, ObjectKind};
use kinetoscope_scene::{Headlight, Hemisphere, Light, LightingSpace, RenderScene, Sky};

/// Lighting of a scene besides its lights.
#[derive(Clone, Debug)]
pub(crate) enum Lighting<'a> {
    /// Lighting of simulations: their own headlight, ambient light and sky, or the first skybox of these models. Light
    /// is summed in linear color space.
    Default {
        /// Models of the MJCF files, whose lights are already in the scene's model.
        files: Vec<&'a Model>,
    },
    /// Lighting of MuJoCo's renderer: the lights, the headlight, the skybox and the haze of one file, and a black
    /// background without a skybox. Light is summed in display color space.
    Mujoco {
        /// Model of the file.
        file: &'a Model,
    },
}

impl<'a> Lighting<'a> {
    /// Selects the lighting of a simulation. A simulation that shows only one MJCF file and the ground, with the
    /// default lights, has MuJoCo's lighting without those lights. Every other simulation has the lighting of
    /// simulations, such as a recorded scene without lights of its own.
    pub(crate) fn of(cfg: &SimulationManagerCfg, contents: &'a EntitySet) -> Self {
        let EntitySet { robots, objects, terrains, mjcf_models, .. } = contents;
        let by_default = cfg.lights == SimulationManagerCfg::default().lights;
        match &mjcf_models[..] {
            [part] if robots.is_empty() && objects.is_empty() && terrains.is_empty() && by_default => {
                Self::Mujoco { file: part.model() }
            }
            _ => Self::Default { files: mjcf_models.iter().map(|part| part.model()).collect() },
        }
    }

    /// Rule by which light is added up.
    pub(super) fn space(&self) -> LightingSpace {
        if self.is_mujoco() { LightingSpace::Display } else { LightingSpace::Linear }
    }

    fn is_mujoco(&self) -> bool {
        matches!(self, Self::Mujoco { .. })
    }
}

/// Sets the lights of `scene` from the model, and its headlight, ambient light, sky and haze as `look` says. Returns
/// messages about active image-based lights, which are not rendered, and about a skybox that cannot be rendered.
pub(super) fn set_lighting(model: &Model, look: &Lighting<'_>, scene: &mut RenderScene) -> Vec<String> {
    let mut left_out = Vec::new();
    let space = look.space();
    scene.lights = (0..model.nlight())
        .map(|index| {
            let light = model.light(index);
            if light.kind == LightType::Image && light.active {
                let name = model.name(ObjectKind::Light, index).unwrap_or_else(|| index.to_string());
                left_out.push(format!("the image-based light {name} is not rendered"));
            }
            scene_light(&light, space)
        })
        .collect();
    let files = match look {
        // MuJoCo's default headlight is not used: this one matches the ambient light of simulations.
        Lighting::Default { files } => {
            scene.headlight = Headlight::default();
            &files[..]
        }
        Lighting::Mujoco { file } => {
            scene.headlight = scene_headlight(&file.headlight());
            scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
            scene.sky = Sky::uniform([0.0; 3]);
            scene.lighting_space = LightingSpace::Display;
            // The light of a simulation: lights of parts cannot have its name, since their names begin with that of the
            // part.
            if !std::ptr::eq(*file, model)
                && let Some(own) = model.id(ObjectKind::Light, &light_name(0)).and_then(|k| scene.lights.get_mut(k))
            {
                own.active = false;
            }
            std::slice::from_ref(file)
        }
    };
    let mut skyboxes = files.iter().filter_map(|file| Some((*file, first_skybox(*file)?)));
    let Some((file, texture)) = skyboxes.next() else { return left_out };
    match skybox(file, texture, space) {
        Ok(image) => scene.skybox = Some(image),
        Err(reason) => {
            let name = file.name(ObjectKind::Texture, texture).unwrap_or_else(|| texture.to_string());
            left_out.push(format!("the skybox {name} is not rendered: {reason}"));
            return left_out;
        }
    }
    if look.is_mujoco() {
        let (color, width) = file.haze();
        scene.horizon = Some(horizon_haze(color, width, file.clip_distances()[1]));
    }
    left_out
}

/// Sum of all dome lights, linear; `None` without a dome light.
pub(super) fn dome_light_sum(lights: &[LightCfg]) -> Option<[f32; 3]> {
    let domes = lights.iter().filter_map(|light| match light.kind {
        LightKindCfg::Dome { intensity } => {
            Some(linear_light(light.color.map(|c| c as f32)).map(|c| c * intensity as f32))
        }
        _ => None,
    });
    domes.reduce(|sum, dome| std::array::from_fn(|k| sum[k] + dome[k]))
}

/// Copies the poses of the lights in `data`.
pub(super) fn read(data: &Data, lights: &[Light], out: &mut [Light]) {
    let (positions, directions) = (data.light_xpos().as_chunks::<3>().0, data.light_xdir().as_chunks::<3>().0);
    for (index, (to, light)) in out.iter_mut().zip(lights).enumerate() {
        let position = positions[index].map(|x| x as f32);
        *to = Light { position, direction: directions[index].map(|x| x as f32), ..*light };
    }
}

#[cfg(test)]
mod tests {
    use super::super::VisualScene;
    use super::*;
    use crate::objects::mjcf_part_data::MjcfPartCfg;
    use crate::objects::rigid_object_data::RigidObjectCfg;
    use crate::simulation_cfg::GroundCfg;
    use crate::{LightCfg, SimulationManager};
    use kinetoscope_mujoco as mj;

    const STARS: &str = r#"<mujoco><statistic extent="2"/>
        <visual><headlight diffuse="0.1 0.2 0.3"/><map zfar="30" haze="0.4"/><rgba haze="0.1 0.2 0.3 1"/></visual>
        <asset><texture name="sky" type="skybox" builtin="gradient" rgb1="0.3 0.5 0.7" rgb2="0 0 0" width="32" height="192"
            mark="random" markrgb="1 1 1" random="0.05"/></asset>
        <worldbody><light name="lamp" pos="0 0 3"/><geom type="plane" size="0 0 1"/>
            <body pos="0 0 1"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"#;

    /// The image of a skybox is MuJoCo's, texel for texel, and haze begins where MuJoCo's renderer has it: infinite
    /// planes end at 0.99 zfar extent / sqrt(2).
    ///
    /// Regression: every skybox was a gradient of three colors, and there was no haze.
    #[test]
    fn skybox_and_haze() {
        let model = mj::compile(STARS, &[]).expect("compiles").into_model();
        let visible = VisualScene::of_model(&model);
        assert_eq!(visible.omitted(), [""; 0]);
        let scene = visible.scene();
        let (image, arrays) = (scene.skybox.as_ref().expect("an image"), model.texture(0).expect("a texture"));
        let level = &image.mip_levels()[0];
        assert_eq!([level.width() as usize, level.height() as usize], [arrays.width, arrays.height]);
        for (k, pixel) in arrays.pixels.chunks_exact(arrays.channels).enumerate() {
            let found = level.pixel((k % arrays.width) as u32, (k / arrays.width) as u32);
            assert_eq!(found[..3], pixel[..3], "texel {k}");
        }
        let haze = scene.horizon.expect("haze");
        assert_eq!((haze.color, haze.width), ([0.1, 0.2, 0.3], 0.4));
        assert!((haze.radius - 59.4 / 2.0f32.sqrt()).abs() < 1e-4, "{haze:?}");
        // Without a skybox MuJoCo renders no haze.
        let plain = mj::compile("<mujoco><worldbody><geom type='plane' size='0 0 1'/></worldbody></mujoco>", &[]);
        let plain = VisualScene::of_model(&plain.expect("compiles").into_model());
        assert!(plain.scene().horizon.is_none() && plain.scene().skybox.is_none());
    }

    /// A light with an image is named as not rendered; switched off, it is not. Only MuJoCo 4 has such lights.
    ///
    /// Regression: the light was dropped without a message.
    #[test]
    fn image_based_light() {
        let file = |active: bool| {
            format!(
                r#"<mujoco><asset><texture name="sky" type="cube" builtin="flat" width="8" height="8"/></asset>
                <worldbody><light name="dome" type="image" texture="sky" active="{active}"/>
                    <geom size="0.1"/></worldbody></mujoco>"#
            )
        };
        if mj::BUILD_VERSION == mj::SupportedVersion::V2 {
            assert!(mj::compile(&file(true), &[]).is_err(), "2.2.2 has no type of lights");
            return;
        }
        let omitted = |active| {
            let model = mj::compile(&file(active), &[]).expect("compiles").into_model();
            VisualScene::of_model(&model).omitted().to_vec()
        };
        assert_eq!(omitted(true), ["the image-based light dome is not rendered"]);
        assert_eq!(omitted(false), [""; 0]);
    }

    /// A simulation that shows one MJCF file has the lighting of that file alone: its lights, headlight, skybox and
    /// haze. With any other content it has the lighting of simulations, and the file's lights and skybox.
    ///
    /// Regression: the headlight of files and their skyboxes were left out of simulations.
    #[test]
    fn look_of_simulations() {
        let scene = |change: &dyn Fn(&mut SimulationManagerCfg), ball: bool| {
            let mut cfg = SimulationManagerCfg { ground: None, ..Default::default() };
            change(&mut cfg);
            let mut sim = SimulationManager::new(cfg).expect("a simulation");
            sim.add_mjcf(MjcfPartCfg::text("stars", STARS)).expect("a part");
            if ball {
                sim.add_rigid_object(RigidObjectCfg::default()).expect("an object");
            }
            let visible = sim.scene_mut().visual_scene();
            (**visible.scene()).clone()
        };
        let active = |scene: &RenderScene| scene.lights.iter().filter(|light| light.active).count();
        let alone = VisualScene::of_model(&mj::compile(STARS, &[]).expect("compiles").into_model());
        let alone = alone.scene();
        let grounds: [&dyn Fn(&mut SimulationManagerCfg); 2] =
            [&|_| {}, &|cfg| cfg.ground = Some(GroundCfg::default())];
        for change in grounds {
            let shown = scene(change, false);
            assert_eq!((shown.headlight, shown.ambient, shown.sky), (alone.headlight, alone.ambient, alone.sky));
            assert_eq!((shown.lighting_space, shown.horizon), (LightingSpace::Display, alone.horizon));
            assert_eq!((shown.skybox.as_ref(), active(&shown)), (alone.skybox.as_ref(), 1), "the file's light");
        }
        let two: &dyn Fn(&mut SimulationManagerCfg) = &|cfg| cfg.lights.push(LightCfg::default());
        let none: &dyn Fn(&mut SimulationManagerCfg) = &|cfg| cfg.lights.clear();
        for (change, ball, lights) in [(grounds[0], true, 2), (two, false, 3), (none, false, 1)] {
            let shown = scene(change, ball);
            assert_eq!((shown.headlight, shown.lighting_space), (Headlight::default(), LightingSpace::Linear));
            // The same image; its mip levels are averaged in linear light.
            let image = |scene: &RenderScene| scene.skybox.as_ref().map(|image| image.mip_levels()[0].clone());
            assert!(image(&shown).is_some() && image(&shown) == image(alone), "another image");
            assert_eq!((shown.horizon, active(&shown)), (None, lights));
        }
    }
}

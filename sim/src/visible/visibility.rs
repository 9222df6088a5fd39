//! Visibility of sites, tendons, skins and flexes by group.

/// Largest group that is rendered by default, as in MuJoCo's viewers.
const MAX_VISIBLE_GROUP: i32 = 2;

/// True if MuJoCo's viewers show a site, tendon, skin or flex.
pub(super) fn is_visible(group: i32, rgba: &[f32]) -> bool {
    group <= MAX_VISIBLE_GROUP && rgba[3] > 0.0
}

#[cfg(test)]
mod tests {
    use super::super::VisualScene;
    use kinetoscope_mujoco as mj;
    use kinetoscope_mujoco::Data;
    use kinetoscope_scene::{Hemisphere, LightingSpace, PoseF32, Sky};

    const SCENE: &str = r#"<mujoco><worldbody>
        <light pos="0 0 3"/>
        <geom type="plane" size="1 1 1"/>
        <site name="goal" pos="0.5 0 0.2" size="0.05" rgba="1 0 0 1"/>
        <site name="hidden" pos="0 0 0.3" group="4"/>
        <body pos="0 0 1"><joint type="slide"/><geom size="0.1"/><site name="end" size="0.02" pos="0.1 0 0"/></body>
        </worldbody>
        <tendon><spatial name="string"><site site="hidden"/><site site="end"/></spatial></tendon></mujoco>"#;

    /// Sites of groups 0 to 2 are rendered at their positions, others are not. A spatial tendon is rendered. Geoms and
    /// tendons have the same mask ids with and without sites.
    ///
    /// Regression: only geoms were rendered, without a message about the rest.
    #[test]
    fn sites_and_tendons() {
        let model = mj::compile(SCENE, &[]).expect("compiles").into_model();
        let (all, geoms) = (VisualScene::with_sites(&model), VisualScene::of_model(&model));
        for visible in [&all, &geoms] {
            assert_eq!(visible.omitted(), [""; 0]);
        }
        let mut data = Data::new(&model).expect("data");
        data.forward().expect("forward");
        let places = |visible: &VisualScene| {
            let scene = visible.scene();
            let (mut poses, mut lights) = (vec![PoseF32::IDENTITY; scene.instances().len()], scene.lights.clone());
            visible.read_poses(&data, &mut poses, &mut lights);
            let scene = visible.scene_at(&data);
            let shown = scene.instances().iter().zip(&poses).filter(|(instance, _)| instance.visible);
            shown.map(|(instance, pose)| (instance.mask_id, pose.translation)).collect::<Vec<_>>()
        };
        // The string is between its two sites.
        let (plane, ball, string) = ((1, [0.0, 0.0, 0.0]), (2, [0.0, 0.0, 1.0]), (3, [0.05, 0.0, 0.65]));
        assert_eq!(places(&geoms), [plane, ball, string]);
        assert_eq!(places(&all), [plane, ball, string, (4, [0.5, 0.0, 0.2]), (2, [0.1, 0.0, 1.0])]);
        let named = |index: usize| (all.mask_ids()[index].name(), all.mask_ids()[index].class.as_str());
        assert_eq!([named(2), named(3)], [("string".into(), "tendon"), ("goal".into(), "world")]);
    }

    /// A model alone is rendered with its own lighting, before a black background.
    #[test]
    fn light_of_the_file() {
        let model = mj::compile(SCENE, &[]).expect("compiles").into_model();
        let visible = VisualScene::of_model(&model);
        let scene = visible.scene();
        assert_eq!((scene.sky, scene.lighting_space), (Sky::uniform([0.0; 3]), LightingSpace::Display));
        assert_eq!(scene.ambient, Hemisphere { sky: [0.0; 3], ground: [0.0; 3] });
        // MuJoCo's values, unchanged.
        assert_eq!((scene.headlight.diffuse, scene.lights[0].diffuse), ([0.4; 3], [0.7; 3]));
        assert!(scene.headlight.active, "also beside lights");
    }
}

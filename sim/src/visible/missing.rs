//! Elements of a model that cameras do not draw.

use crate::mj::{self, Model, ObjectKind};

/// The largest geom group that is drawn by default, as in MuJoCo's viewers.
const LAST_SHOWN_GROUP: i32 = 2;
/// Names in a message, at most.
const NAMED: usize = 4;

/// True if a site or a tendon is shown by MuJoCo's viewers.
pub(super) fn is_shown(group: i32, rgba: &[f32]) -> bool {
    (0..=LAST_SHOWN_GROUP).contains(&group) && rgba[3] > 0.0
}

/// One message for each kind of element that is not drawn.
pub(super) fn of_model(model: &Model) -> Vec<String> {
    let mut out = Vec::new();
    let tendons = (0..model.ntendon()).filter(|&tendon| {
        let first = model.tendon_adr()[tendon] as usize;
        let spatial = model.wrap_type().get(first).is_some_and(|kind| *kind as u32 != mj::mjWRAP_JOINT);
        spatial && is_shown(model.tendon_group()[tendon], &model.tendon_rgba()[4 * tendon..4 * tendon + 4])
    });
    let named = |kind, index: usize| model.name(kind, index).unwrap_or_else(|| index.to_string());
    let tendons: Vec<String> = tendons.map(|tendon| named(ObjectKind::Tendon, tendon)).collect();
    out.extend(message(["spatial tendon", "spatial tendons"], &tendons));
    let skins: Vec<String> = (0..model.nskin()).map(|skin| skin.to_string()).collect();
    out.extend(message(["skin", "skins"], &skins));
    let flexes: Vec<String> = (0..model.nflex()).map(|flex| flex.to_string()).collect();
    out.extend(message(["flex", "flexes"], &flexes));
    out
}

/// The message about elements of a kind, which is named for one and for many.
fn message([one, many]: [&str; 2], names: &[String]) -> Option<String> {
    let mut list = names.iter().take(NAMED).map(String::as_str).collect::<Vec<_>>().join(", ");
    if names.len() > NAMED {
        list += &format!(" and {} more", names.len() - NAMED);
    }
    match names.len() {
        0 => None,
        1 => Some(format!("the {one} {list} is not drawn: cameras do not draw {many}")),
        count => Some(format!("{count} {many} are not drawn ({list}): cameras do not draw {many}")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Visible;
    use crate::mj::{self, Data};
    use kinetoscope_scene::{Hemisphere, LightSum, PoseF32, Sky};

    const SCENE: &str = r#"<mujoco><worldbody>
        <light pos="0 0 3"/>
        <geom type="plane" size="1 1 1"/>
        <site name="goal" pos="0.5 0 0.2" size="0.05" rgba="1 0 0 1"/>
        <site name="hidden" pos="0 0 0.3" group="4"/>
        <body pos="0 0 1"><joint type="slide"/><geom size="0.1"/><site name="end" size="0.02" pos="0.1 0 0"/></body>
        </worldbody>
        <tendon><spatial name="string"><site site="hidden"/><site site="end"/></spatial></tendon></mujoco>"#;

    /// A spatial tendon is named as not drawn. Sites of groups 0 to 2 are drawn where they are, the others are not; geoms
    /// alone have the mask ids that they have beside sites.
    ///
    /// Root cause once: only geoms were drawn, and nothing said so.
    #[test]
    fn sites_and_tendons() {
        let model = mj::compile(SCENE, &[]).expect("compiles").into_model();
        let (all, geoms) = (Visible::with_sites(&model), Visible::of_model(&model));
        for visible in [&all, &geoms] {
            let message = "the spatial tendon string is not drawn: cameras do not draw spatial tendons";
            assert_eq!(visible.left_out(), [message]);
        }
        let mut data = Data::new(&model).expect("data");
        data.forward().expect("forward");
        let places = |visible: &Visible| {
            let scene = visible.scene();
            let (mut poses, mut lights) = (vec![PoseF32::IDENTITY; scene.instances().len()], scene.lights.clone());
            visible.read(&data, &mut poses, &mut lights);
            let ids = scene.instances().iter().map(|i| i.mask_id);
            ids.zip(poses.iter().map(|pose| pose.translation)).collect::<Vec<_>>()
        };
        let (plane, ball) = ((1, [0.0, 0.0, 0.0]), (2, [0.0, 0.0, 1.0]));
        assert_eq!(places(&geoms), [plane, ball]);
        assert_eq!(places(&all), [plane, ball, (3, [0.5, 0.0, 0.2]), (2, [0.1, 0.0, 1.0])]);
        assert_eq!((all.ids()[2].name().as_str(), all.ids()[2].class.as_str()), ("goal", "world"));
    }

    /// A model alone is drawn in its own light, before a black background.
    #[test]
    fn light_of_the_file() {
        let model = mj::compile(SCENE, &[]).expect("compiles").into_model();
        let visible = Visible::of_model(&model);
        let scene = visible.scene();
        assert_eq!((scene.sky, scene.light_sum), (Sky::uniform([0.0; 3]), LightSum::Display));
        assert_eq!(scene.ambient, Hemisphere { sky: [0.0; 3], ground: [0.0; 3] });
        // MuJoCo's numbers, as they are.
        assert_eq!((scene.headlight.diffuse, scene.lights[0].diffuse), ([0.4; 3], [0.7; 3]));
        assert!(scene.headlight.active, "also beside lights");
    }
}

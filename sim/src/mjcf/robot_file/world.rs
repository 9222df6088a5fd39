//! Elements of the file's `<worldbody>`, which are omitted from a robot, and elements that refer to them.

use super::error::RobotFileError;
use super::locations::SourceLocations;
use crate::mjcf::part::{OmittedElement, PartNames, sensors_left_out};
use kinetoscope_mujoco::Model;
use kinetoscope_mujoco::mjcf_keywords;
use kinetoscope_mujoco::mjcf_keywords::WrapType;
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::source_location::SourceLocation;
use std::collections::BTreeSet;

/// Converts an index of MuJoCo; `None` for -1, which stands for no object.
fn mj_index(index: i32) -> Option<usize> {
    usize::try_from(index).ok()
}

/// Warns about elements of the file's world. Rejects tendons through its sites or around its geoms, and equalities of
/// its sites.
pub(super) fn check(
    owner: &str,
    model: &Model,
    names: &PartNames,
    places: &SourceLocations,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<(), RobotFileError> {
    let in_world = |bodies: &[i32], kind: &'static str, of: &[String]| {
        let here = bodies.iter().enumerate().filter(|(_, body)| **body == 0);
        here.map(|(index, _)| format!("{kind} {:?}", of[index])).collect::<Vec<_>>()
    };
    let mut left_out = in_world(model.geom_bodyid(), "geom", &names.geoms);
    left_out.extend(in_world(model.site_bodyid(), "site", &names.sites));
    left_out.extend(in_world(model.cam_bodyid(), "camera", &names.cameras));
    left_out.extend(in_world(model.light_bodyid(), "light", &names.lights));
    if !left_out.is_empty() {
        let message = format!("{owner}: elements directly in <worldbody> are not imported: {}", left_out.join(", "));
        diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, places.file(), message));
    }
    let needs = |element: &'static str, name: &str, needs: &str| RobotFileError::NeedsWorld {
        at: places.get(element, name),
        element,
        name: name.into(),
        needs: needs.into(),
    };
    for tendon in 0..model.ntendon() {
        let first = model.tendon_adr()[tendon] as usize;
        for point in first..first + model.tendon_num()[tendon] as usize {
            let Some(id) = mj_index(model.wrap_objid()[point]) else { continue };
            let site = |id: usize| (model.site_bodyid()[id] == 0).then(|| &names.sites[id]);
            let used = match mjcf_keywords::wrap_type(model.wrap_type()[point]) {
                Some(WrapType::Site) => site(id),
                Some(WrapType::Geom) => {
                    let geom = (model.geom_bodyid()[id] == 0).then(|| &names.geoms[id]);
                    geom.or_else(|| mj_index(model.wrap_prm()[point].round() as i32).and_then(site))
                }
                _ => None,
            };
            if let Some(used) = used {
                return Err(needs("tendon", &names.tendons[tendon], used));
            }
        }
    }
    for equality in (0..model.neq()).filter(|&equality| model.equality_is_between_sites(equality)) {
        let sites = [model.eq_obj1id()[equality], model.eq_obj2id()[equality]];
        if let Some(site) = sites.into_iter().filter_map(mj_index).find(|&site| model.site_bodyid()[site] == 0) {
            return Err(needs("equality", &names.equalities[equality], &names.sites[site]));
        }
    }
    Ok(())
}

/// Sensors that a robot cannot have, with their indices in ascending order: those that no part can have, those of
/// actuators and their forces, and those of elements of the file's world.
pub(super) fn sensors(model: &Model, names: &PartNames) -> Vec<(usize, OmittedElement)> {
    let mut left_out = sensors_left_out(model, names);
    for sensor in 0..model.nsensor() {
        if left_out.iter().any(|(other, _)| *other == sensor) {
            continue;
        }
        // Drives are friction rows or forces of this crate, which MuJoCo's sum over actuators does not include.
        let word = mjcf_keywords::sensor(model.sensor_type()[sensor]).map_or("", |word| word.keyword);
        if matches!(word, "jointactuatorfrc" | "tendonactuatorfrc") {
            let property = format!("the type {word}: it measures actuator forces, and drives replace the actuators");
            left_out
                .push((sensor, OmittedElement { element: "sensor", name: names.sensors[sensor].clone(), property }));
            continue;
        }
        let observed = [
            (model.sensor_objtype()[sensor], model.sensor_objid()[sensor]),
            (model.sensor_reftype()[sensor], model.sensor_refid()[sensor]),
        ];
        let omitted = observed.into_iter().find_map(|(kind, id)| {
            let (word, id) = (mjcf_keywords::object_type(kind)?, mj_index(id)?);
            let (name, is_gone) = match word {
                "actuator" => (&names.actuators[id], true),
                "geom" => (&names.geoms[id], model.geom_bodyid()[id] == 0),
                "site" => (&names.sites[id], model.site_bodyid()[id] == 0),
                "camera" => (&names.cameras[id], model.cam_bodyid()[id] == 0),
                _ => return None,
            };
            is_gone.then(|| format!("{word} {name:?}, which a robot does not import"))
        });
        if let Some(property) = omitted {
            left_out
                .push((sensor, OmittedElement { element: "sensor", name: names.sensors[sensor].clone(), property }));
        }
    }
    left_out.sort_by_key(|(sensor, _)| *sensor);
    left_out
}

/// Warns about contacts of the file that the robot does not have: geom pairs that are left out, and excluded pairs with
/// the file's world.
pub(super) fn warn_contacts(
    owner: &str,
    model: &Model,
    names: &PartNames,
    self_collision: bool,
    file: &SourceLocation,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let mut say = |message: String| {
        diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, file.clone(), format!("{owner}: {message}")));
    };
    let geom = |id: i32| mj_index(id).map_or_else(String::new, |id| format!("{:?}", names.geoms[id]));
    let named = |pairs: &BTreeSet<usize>| {
        let named = |&p: &usize| format!("{} and {}", geom(model.pair_geom1()[p]), geom(model.pair_geom2()[p]));
        pairs.iter().map(named).collect::<Vec<_>>().join(", ")
    };
    let with_world = omitted_pairs(model, true);
    if !with_world.is_empty() {
        let colliding: Vec<String> =
            pair_only_geoms(model).iter().map(|&id| format!("{:?}", names.geoms[id])).collect();
        let more = match colliding.as_slice() {
            [] => String::new(),
            geoms => format!(
                "; these geoms collided only in such pairs, and now collide like the other geoms of the robot: {}",
                geoms.join(", ")
            ),
        };
        say(format!(
            "contact pairs with geoms of <worldbody> are not imported, including their friction and solver parameters: \
             {}{more}",
            named(&with_world)
        ));
    }
    let own = &omitted_pairs(model, self_collision) - &with_world;
    if !own.is_empty() {
        say(format!("contact pairs between its own geoms are used only with self_collision: true: {}", named(&own)));
    }
    for bodies in model.excluded_bodies().filter(|bodies| bodies.contains(&0)) {
        let body = &names.bodies[bodies[0].max(bodies[1])];
        say(format!(
            "body {body:?} collides with the scene, although the file excludes contacts between this body and its world"
        ));
    }
}

/// Geoms of the robot whose bits disable collisions, but that the file pairs with geoms of its world.
pub(super) fn pair_only_geoms(model: &Model) -> BTreeSet<usize> {
    let mut geoms = BTreeSet::new();
    for pair in omitted_pairs(model, true) {
        let both = [model.pair_geom1()[pair], model.pair_geom2()[pair]];
        geoms.extend(both.into_iter().filter_map(mj_index).filter(|&geom| {
            model.geom_bodyid()[geom] > 0 && model.geom_contype()[geom] == 0 && model.geom_conaffinity()[geom] == 0
        }));
    }
    geoms
}

/// Indices of the `<pair>` elements that are omitted: pairs with geoms of the file's world, and all pairs of a robot
/// without self-collision.
pub(super) fn omitted_pairs(model: &Model, self_collision: bool) -> BTreeSet<usize> {
    let of_world = |geom: i32| mj_index(geom).is_some_and(|geom| model.geom_bodyid()[geom] == 0);
    let is_left_out =
        |pair: &usize| !self_collision || of_world(model.pair_geom1()[*pair]) || of_world(model.pair_geom2()[*pair]);
    (0..model.npair()).filter(is_left_out).collect()
}

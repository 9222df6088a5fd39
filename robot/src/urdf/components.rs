//! Tree of URDF components: the parent of each component and the order of merging.

use super::config::{ComponentCfg, UrdfCfg};
use super::error::UrdfError;
use super::tree::owned;
use kinetoscope_scene::pattern::closest_names;
use std::collections::HashMap;

/// Default parents of a component, best first.
///
/// Source: EmbodiChain's assembly. Legs are a parent of the torso only in a robot with a chassis.
fn usual_parents(name: &str, present: impl Fn(&str) -> bool) -> &'static [&'static str] {
    match name {
        "legs" => &["chassis"],
        "torso" if present("chassis") => &["legs", "chassis"],
        "head" | "left_arm" | "right_arm" | "arm" => &["torso", "chassis"],
        "left_hand" => &["left_arm"],
        "right_hand" => &["right_arm"],
        "hand" => &["arm"],
        _ => &[],
    }
}

/// Component names with a default place: without their default parent they are roots.
const DEFAULT_NAMES: [&str; 10] =
    ["chassis", "legs", "torso", "head", "left_arm", "right_arm", "left_hand", "right_hand", "arm", "hand"];

/// Parent of each component, and an order in which parents come first.
#[derive(Debug)]
pub(super) struct ComponentTree {
    /// Index of the parent of each component; `None` for a root.
    pub(super) parents: Vec<Option<usize>>,
    /// All components, parents first, otherwise in the order of the configuration.
    pub(super) order: Vec<usize>,
}

impl ComponentTree {
    /// Checks the configuration and arranges its components.
    pub(super) fn new(cfg: &UrdfCfg) -> Result<Self, UrdfError> {
        if cfg.components.is_empty() {
            return Err(UrdfError::NoComponents);
        }
        let mut ids = HashMap::new();
        for (id, component) in cfg.components.iter().enumerate() {
            check(component)?;
            if ids.insert(component.name.as_str(), id).is_some() {
                return Err(UrdfError::ComponentRepeated { component: component.name.clone() });
            }
        }
        let parents = (0..cfg.components.len()).map(|id| parent(cfg, id, &ids)).collect::<Result<Vec<_>, _>>()?;
        let order = parents_first(cfg, &parents)?;
        Ok(Self { parents, order })
    }

    /// Number of components without a parent.
    pub(super) fn roots(&self) -> usize {
        self.parents.iter().filter(|p| p.is_none()).count()
    }
}

fn check(component: &ComponentCfg) -> Result<(), UrdfError> {
    let invalid = |problem: &str| {
        Err(UrdfError::ComponentInvalid { component: component.name.clone(), problem: problem.to_owned() })
    };
    let unusable = |text: &str| text.chars().any(char::is_control);
    if component.name.trim().is_empty() || unusable(&component.name) {
        return invalid("a component needs a name with visible characters, such as \"arm\"");
    }
    if component.prefix.as_deref().is_some_and(unusable) {
        return invalid("the prefix has a control character");
    }
    let (t, q) = (component.transform.translation.vector, component.transform.rotation);
    if !t.iter().chain(q.coords.iter()).all(|c| c.is_finite()) {
        return invalid("the transform is not finite");
    }
    if (q.norm() - 1.0).abs() > 1e-6 {
        return invalid("the rotation of the transform is not a unit quaternion");
    }
    Ok(())
}

fn parent(cfg: &UrdfCfg, id: usize, ids: &HashMap<&str, usize>) -> Result<Option<usize>, UrdfError> {
    let component = &cfg.components[id];
    let others = |name: &str| {
        owned(closest_names(name, cfg.components.iter().map(|c| c.name.as_str()).filter(|n| *n != component.name)))
    };
    if let Some(parent) = &component.parent {
        return match ids.get(parent.as_str()) {
            Some(&found) => Ok(Some(found)),
            None => Err(UrdfError::ComponentUnknown {
                component: component.name.clone(),
                parent: parent.clone(),
                candidates: others(parent),
            }),
        };
    }
    let usual = usual_parents(&component.name, |name| ids.contains_key(name));
    let found = usual.iter().find_map(|name| ids.get(name).copied());
    // A custom name without a parent is a root only as the first component.
    if found.is_none() && id != 0 && !DEFAULT_NAMES.contains(&component.name.as_str()) {
        return Err(UrdfError::ComponentParentRequired {
            component: component.name.clone(),
            candidates: others(&component.name),
        });
    }
    Ok(found)
}

fn parents_first(cfg: &UrdfCfg, parents: &[Option<usize>]) -> Result<Vec<usize>, UrdfError> {
    let mut order = Vec::new();
    let mut placed = vec![false; parents.len()];
    while order.len() < parents.len() {
        let next = (0..parents.len()).find(|&c| !placed[c] && parents[c].is_none_or(|p| placed[p]));
        let Some(next) = next else { return Err(cycle_error(cfg, parents, &placed)) };
        placed[next] = true;
        order.push(next);
    }
    Ok(order)
}

fn cycle_error(cfg: &UrdfCfg, parents: &[Option<usize>], placed: &[bool]) -> UrdfError {
    let mut walk: Vec<usize> = Vec::new();
    let mut next = placed.iter().position(|p| !p);
    while let Some(component) = next {
        if let Some(start) = walk.iter().position(|&c| c == component) {
            walk.drain(..start);
            break;
        }
        walk.push(component);
        next = parents[component];
    }
    UrdfError::ComponentCycle { components: walk.into_iter().map(|c| cfg.components[c].name.clone()).collect() }
}

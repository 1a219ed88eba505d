"""Cases and fits from the files that earlier steps wrote."""

from elastocal.json_files import read_json
from elastocal.loop.case import case_from, noise_from
from elastocal.loop.schemas import FOUND, PARAMETERS, readings
from elastocal.storage import read_table


def opened_case(descriptions_path, readings_path, part=None):
    """A campaign from the files of step 1.

    Parameters
    ----------
    descriptions_path, readings_path : str
    part : {"held_out"}, optional
        The campaign that holds the test, where it is another one.

    Returns
    -------
    Case
    """
    descriptions = read_json(descriptions_path)
    described = (part and descriptions[part]) or descriptions
    joints = len(described["robot"]["compliance_urad_per_Nm"])
    return case_from(described, read_table(readings_path, readings(joints)))


def opened_fit(case, parameters_path, noise_path, found_path=None):
    """A fit from its parameters table.

    Parameters
    ----------
    case : Case
    parameters_path, noise_path : str
    found_path : str, optional
        Effects found, which the fit has beside the declared model.

    Returns
    -------
    fitted : Fit
    found : list of Candidate
    """
    keys = read_table(found_path, FOUND)["candidate"] if found_path else []
    model, found = case.with_found(keys)
    return case.fitted(model, read_table(parameters_path, PARAMETERS), noise_from(read_json(noise_path))), found

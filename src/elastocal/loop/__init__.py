"""Steps of closing the loop on one campaign, each from tables to tables; the science is in the modules above this folder."""

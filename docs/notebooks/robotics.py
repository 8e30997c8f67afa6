# %% [markdown]
# # robotics

# %%
import symrefine

print(symrefine.__version__)
